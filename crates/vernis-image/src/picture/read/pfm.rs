//! PFM, the portable float map: `PF` (RGB) or `Pf` (grey), width and height, a scale, each ended by white space; then 32-bit numbers
//! from the bottom row up, little-endian where the scale is negative. Own code: neither `image` 0.24 nor `exr` reads it.

use crate::picture::encoded::check_size;
use crate::picture::{EncodedPicture, Encoding, PictureError};
use vernis_metric::io::shown;

/// Longest number of a header.
const LONGEST_WORD: usize = 32;

pub(super) fn decode(bytes: &[u8]) -> Result<EncodedPicture, PictureError> {
    let wrong = |reason: String| PictureError::Content { format: "PFM", reason };
    let mut rest = &bytes[2..];
    let channels = if bytes[1] == b'F' { 3 } else { 1 };
    let width = side(word(&mut rest), "width").map_err(wrong)?;
    let height = side(word(&mut rest), "height").map_err(wrong)?;
    check_size(width, height)?;
    let scale = word(&mut rest);
    let little = match scale.parse::<f32>() {
        Ok(-1.0) => true,
        Ok(1.0) => false,
        _ => {
            let scale = shown(&scale, LONGEST_WORD);
            return Err(wrong(format!("its scale is \"{scale}\"; it must be -1 (little-endian) or 1 (big-endian)")));
        }
    };
    let expected = width * height * channels * 4;
    if rest.len() != expected {
        return Err(wrong(format!("its pixels take {} bytes; {width} x {height} must take {expected}", rest.len())));
    }
    let number = |four: &[u8]| {
        let four = [four[0], four[1], four[2], four[3]];
        if little { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) }
    };
    let pixel = |bytes: &[u8]| -> [f32; 3] {
        if channels == 1 { [number(bytes); 3] } else { [0, 4, 8].map(|at| number(&bytes[at..at + 4])) }
    };
    let row = width * channels * 4;
    let pixels = rest.chunks_exact(row).rev().flat_map(|row| row.chunks_exact(channels * 4).map(pixel)).collect();
    EncodedPicture::new(width, height, pixels, Encoding::Linear)
}

/// The next word of a header, and the one white-space character that ends it.
fn word(rest: &mut &[u8]) -> String {
    let space = |b: &u8| b.is_ascii_whitespace();
    let start = rest.iter().position(|b| !space(b)).unwrap_or(rest.len());
    let from = &rest[start..];
    let end = from.iter().take(LONGEST_WORD + 1).position(space).unwrap_or(from.len().min(LONGEST_WORD));
    *rest = from.get(end + 1..).unwrap_or(&[]);
    String::from_utf8_lossy(&from[..end]).into_owned()
}

fn side(word: String, name: &str) -> Result<usize, String> {
    word.parse().map_err(|_| format!("its {name} is \"{}\"; it must be a whole number", shown(&word, LONGEST_WORD)))
}
