//! Files that hold reflectance functions, one file format each.
