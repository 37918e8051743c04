//! Nothing: the benches and tests beside it are what the package is for.
