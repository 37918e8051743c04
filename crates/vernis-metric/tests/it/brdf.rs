//! Reflectance sources against values from outside, and every way in which a file can be wrong.
//!
//! Tests of published data take its folder from `VERNIS_DATA`.

mod bad_input;
mod models;
mod published;
mod rgl;
mod tables;

use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::{Brdf, BrdfError, BrdfSource};

fn open(notation: &str, base: &Path) -> Result<Arc<dyn Brdf>, BrdfError> {
    BrdfSource::parse(notation)?.open(Some(base)).map(|open| open.brdf)
}

/// The message of an error that must occur; one line.
fn message<T>(result: Result<T, BrdfError>) -> String {
    let text = result.err().expect("the input is wrong").to_string();
    assert!(!text.contains('\n'), "{text}");
    text
}
