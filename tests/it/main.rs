//! The one integration binary.

mod lp;
mod lp_golden;
mod naive_lp;
