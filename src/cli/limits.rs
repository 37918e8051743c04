//! The limits of arguments: each parser refuses what is out of range while arguments are read, before any work, and says what is
//! allowed.

use crate::evaluation::bootstrap::{MAX_RESAMPLES, MIN_RESAMPLES};
use std::fmt::Display;
use std::io::ErrorKind;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;
use vernis_metric::io::open_regular;

/// Of cross-validation, by material.
pub const FOLDS: RangeInclusive<usize> = 2..=1000;
/// Longest name of a metric.
#[cfg(feature = "train")]
const LONGEST_NAME: usize = 100;

/// An integer of a range.
pub fn integer<T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static>(
    range: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text: &str| {
        let allowed = || format!("it must be an integer from {} to {}", range.start(), range.end());
        text.trim().parse().ok().filter(|n| range.contains(n)).ok_or_else(allowed)
    }
}

/// A number of folds by material.
pub fn folds(text: &str) -> Result<usize, String> {
    integer(FOLDS)(text)
}

/// A number of bootstrap resamples.
pub fn resamples(text: &str) -> Result<usize, String> {
    integer(MIN_RESAMPLES..=MAX_RESAMPLES)(text)
}

/// A seed.
pub fn seed(text: &str) -> Result<u64, String> {
    integer(0..=u64::MAX)(text)
}

/// The name of a metric that is exported: it becomes the name of a file.
#[cfg(feature = "train")]
pub fn metric_name(text: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let first = text.chars().next().is_some_and(|c| c.is_ascii_alphanumeric());
    if first && text.len() <= LONGEST_NAME && text.chars().all(plain) {
        return Ok(text.to_owned());
    }
    Err(format!(
        "it must begin with a letter or digit and have at most {LONGEST_NAME} letters, digits, `-`, `_` and `.`"
    ))
}

/// The path of a file that is there.
pub fn file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match open_regular(&path) {
        Ok(_) => Ok(path),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(format!("{error}; it must be the name of a file")),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_say_what_is_allowed() {
        assert_eq!(integer(2..=5)("5"), Ok(5));
        for wrong in ["1", "6", "-1", "x", "", "3.0", "99999999999999999999999"] {
            assert_eq!(integer(2..=5)(wrong).unwrap_err(), "it must be an integer from 2 to 5", "{wrong}");
        }
        assert_eq!(seed("18446744073709551615"), Ok(u64::MAX));
        assert!(seed("18446744073709551616").is_err() && seed("-1").is_err());
        assert_eq!(resamples("39").unwrap_err(), "it must be an integer from 40 to 20000");
    }

    #[cfg(feature = "train")]
    #[test]
    fn names_of_metrics_are_names_of_files() {
        assert_eq!(metric_name("mine-2.v1"), Ok("mine-2.v1".to_owned()));
        let long = "a".repeat(101);
        for wrong in
            ["../evil", "a/b", "/tmp/x", "", ".", "..", ".hidden", "-x", "a b", "a\u{1b}[31m", "ä", "a\\b", &long]
        {
            assert!(metric_name(wrong).unwrap_err().starts_with("it must begin with a letter or digit"), "{wrong}");
        }
    }

    #[test]
    fn files_must_be_there() {
        let place = tempfile::tempdir().unwrap();
        assert!(file(place.path().to_str().unwrap()).unwrap_err().starts_with("it is a folder;"));
        assert!(file("nowhere.hdr").unwrap_err().contains("No such file"));
        std::fs::write(place.path().join("x.hdr"), "").unwrap();
        assert!(file(place.path().join("x.hdr").to_str().unwrap()).is_ok());
    }
}
