//! Metrics that compare two pictures, one file each.
