//! Pictures of files: PNG, JPEG, OpenEXR, Radiance HDR and PFM.
//!
//! | format | reader | numbers |
//! | --- | --- | --- |
//! | PNG, 1 to 16 bits | crate `image` | sRGB codes; the chunks gAMA, cHRM and iCCP are not applied |
//! | JPEG, 8 bits | crate `image` | sRGB codes; embedded profiles are not applied |
//! | OpenEXR | crate `exr` | cd/m2, channels R, G, B or Y |
//! | Radiance HDR | crate `image` | cd/m2, divided by the exposure of the header |
//! | PFM | own: `image` 0.24 has none | cd/m2 |
//!
//! The format is that of the content, whatever the file is called. Grey pictures become three equal channels. An alpha channel must
//! be opaque everywhere. A file may have [`MOST_BYTES`] and its picture [`MOST_PIXELS`]; both are checked before pixels are decoded.

mod exr;
mod pfm;

use super::encoded::check_size;
use super::{EncodedPicture, Encoding, MOST_PIXELS, PictureError, ReadError};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageFormat};
use std::io::Cursor;
use std::path::Path;
use vernis_metric::io::{read_at_most, shown};

/// Largest file that is read, in bytes: [`MOST_PIXELS`] of three 32-bit numbers, and a header.
pub const MOST_BYTES: u64 = MOST_PIXELS as u64 * 12 + (1 << 20);

/// Bytes that a decoder may take for itself: [`MOST_PIXELS`] of four 16-bit codes.
const MOST_ALLOCATED: u64 = MOST_PIXELS as u64 * 8 + (1 << 24);

/// Pixels that a byte of a Radiance file can stand for, at the most: a run in its older encoding.
const HDR_PIXELS_PER_BYTE: usize = 64;

/// The picture of a file.
///
/// # Errors
/// [`ReadError`]: the file cannot be read, is too large, damaged, or holds what no metric can use.
pub fn read(path: &Path) -> Result<EncodedPicture, ReadError> {
    let of_file = |why| ReadError { path: path.to_owned(), why };
    let bytes = read_at_most(path, MOST_BYTES).map_err(|error| of_file(error.into()))?;
    decode(&bytes).map_err(of_file)
}

/// The picture of the bytes of a file.
///
/// # Errors
/// [`PictureError`]: the bytes are damaged, or hold what no metric can use.
pub fn decode(bytes: &[u8]) -> Result<EncodedPicture, PictureError> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => codes(bytes, ImageFormat::Png, "PNG"),
        [0xff, 0xd8, 0xff, ..] => codes(bytes, ImageFormat::Jpeg, "JPEG"),
        [0x76, 0x2f, 0x31, 0x01, ..] => exr::decode(bytes),
        [b'#', b'?', ..] => radiance(bytes),
        [b'P', b'F' | b'f', b'\n' | b'\r' | b' ' | b'\t', ..] => pfm::decode(bytes),
        _ => Err(PictureError::Format { found: beginning(bytes) }),
    }
}

fn beginning(bytes: &[u8]) -> String {
    match bytes.get(..bytes.len().min(8)) {
        None | Some([]) => "nothing".to_owned(),
        Some(first) => format!("\"{}\"", shown(&String::from_utf8_lossy(first), 8)),
    }
}

/// A picture of 8- or 16-bit codes.
fn codes(bytes: &[u8], format: ImageFormat, name: &'static str) -> Result<EncodedPicture, PictureError> {
    let failed = |reason: image::ImageError| PictureError::Content { format: name, reason: reason.to_string() };
    let reader = || {
        let mut reader = image::io::Reader::with_format(Cursor::new(bytes), format);
        let mut limits = image::io::Limits::default();
        limits.max_alloc = Some(MOST_ALLOCATED);
        reader.limits(limits);
        reader
    };
    let (width, height) = reader().into_dimensions().map_err(failed)?;
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    let picture = reader().decode().map_err(failed)?;
    let narrow = |v: u8| f32::from(v);
    // Exact to a part in 2^24 of the code; those of 8 bits come out whole.
    let wide = |v: u16| f32::from(v) / 257.0;
    let grey = |v: f32| [v; 3];
    let opaque = |alpha: Vec<f32>| opaque(&alpha, width);
    let pixels = match picture {
        DynamicImage::ImageLuma8(p) => p.pixels().map(|p| grey(narrow(p.0[0]))).collect(),
        DynamicImage::ImageLuma16(p) => p.pixels().map(|p| grey(wide(p.0[0]))).collect(),
        DynamicImage::ImageRgb8(p) => p.pixels().map(|p| p.0.map(narrow)).collect(),
        DynamicImage::ImageRgb16(p) => p.pixels().map(|p| p.0.map(wide)).collect(),
        DynamicImage::ImageLumaA8(p) => {
            opaque(p.pixels().map(|p| narrow(p.0[1]) / 255.0).collect())?;
            p.pixels().map(|p| grey(narrow(p.0[0]))).collect()
        }
        DynamicImage::ImageLumaA16(p) => {
            opaque(p.pixels().map(|p| wide(p.0[1]) / 255.0).collect())?;
            p.pixels().map(|p| grey(wide(p.0[0]))).collect()
        }
        DynamicImage::ImageRgba8(p) => {
            opaque(p.pixels().map(|p| narrow(p.0[3]) / 255.0).collect())?;
            p.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(narrow)).collect()
        }
        DynamicImage::ImageRgba16(p) => {
            opaque(p.pixels().map(|p| wide(p.0[3]) / 255.0).collect())?;
            p.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(wide)).collect()
        }
        other => {
            let reason = format!("its pixels are {:?}; they must be grey or RGB codes of 8 or 16 bits", other.color());
            return Err(PictureError::Content { format: name, reason });
        }
    };
    EncodedPicture::new(width, height, pixels, Encoding::Srgb)
}

/// That nothing shines through a picture of `width` columns.
fn opaque(alpha: &[f32], width: usize) -> Result<(), PictureError> {
    match alpha.iter().position(|a| *a != 1.0) {
        None => Ok(()),
        Some(i) => Err(PictureError::Alpha { x: i % width, y: i / width, alpha: alpha[i] }),
    }
}

/// A Radiance picture (RGBE).
fn radiance(bytes: &[u8]) -> Result<EncodedPicture, PictureError> {
    let wrong = |reason: String| PictureError::Content { format: "Radiance HDR", reason };
    let decoder = HdrDecoder::new(bytes).map_err(|e| wrong(e.to_string()))?;
    let header = decoder.metadata();
    let (width, height) = (header.width as usize, header.height as usize);
    check_size(width, height)?;
    // Before the pixels are held: a header may promise what no body can keep.
    if width * height > bytes.len().saturating_mul(HDR_PIXELS_PER_BYTE) {
        return Err(wrong(format!("{} bytes cannot hold its {width} x {height} pixels", bytes.len())));
    }
    let exposure = header.exposure.unwrap_or(1.0);
    if !(exposure.is_finite() && exposure > 0.0) {
        return Err(wrong(format!("its exposure is {exposure}; it must be greater than 0")));
    }
    let pixels = decoder.read_image_native().map_err(|e| wrong(e.to_string()))?;
    let pixels = pixels.into_iter().map(|p| p.to_hdr().0.map(|v| v / exposure)).collect();
    EncodedPicture::new(width, height, pixels, Encoding::Linear)
}
