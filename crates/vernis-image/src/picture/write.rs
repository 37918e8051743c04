//! Pictures into files: OpenEXR with 32-bit floats (crate `exr`), PNG with 8 bits (crate `image`). A file is written whole or not at all.

use super::Picture;
use exr::prelude::{Encoding, Image, SpecificChannels, Vec2, WritableImage};
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use thiserror::Error;
use vernis_metric::io::write_atomically;

/// Why a picture could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum WriteError {
    #[error("{}: {cause}", path.display())]
    Io { path: PathBuf, cause: std::io::Error },
    #[error("the picture cannot be encoded as {format}: {reason}")]
    Encode { format: &'static str, reason: String },
    #[error("{found} bytes are no RGB picture of {width}x{height} pixels")]
    Size { found: usize, width: usize, height: usize },
}

impl Picture {
    /// The bytes of an OpenEXR file: linear RGB, 32-bit floats, compressed without loss.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn to_exr(&self) -> Result<Vec<u8>, WriteError> {
        let failed = |e: exr::error::Error| WriteError::Encode { format: "OpenEXR", reason: e.to_string() };
        let pixels = SpecificChannels::rgb(|Vec2(x, y): Vec2<usize>| {
            let [r, g, b] = self.pixels[y * self.width + x];
            (r, g, b)
        });
        let mut image = Image::from_channels((self.width, self.height), pixels);
        image.layer_data.encoding = Encoding::FAST_LOSSLESS;
        let mut bytes = Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes).map_err(failed)?;
        Ok(bytes.into_inner())
    }

    /// Writes an OpenEXR file.
    ///
    /// # Errors
    /// What the encoder or the operating system says.
    pub fn write_exr(&self, path: &Path) -> Result<(), WriteError> {
        write(path, &self.to_exr()?)
    }
}

/// The bytes of a PNG file of 8-bit RGB values, row by row from the top left.
///
/// # Errors
/// Another number of values, or what the encoder says.
pub fn to_png(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>, WriteError> {
    let size = || WriteError::Size { found: rgb.len(), width, height };
    if width.checked_mul(height).and_then(|n| n.checked_mul(3)) != Some(rgb.len()) {
        return Err(size());
    }
    let (w, h) = (u32::try_from(width).map_err(|_| size())?, u32::try_from(height).map_err(|_| size())?);
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    let failed = |e: image::ImageError| WriteError::Encode { format: "PNG", reason: e.to_string() };
    encoder.write_image(rgb, w, h, image::ColorType::Rgb8).map_err(failed)?;
    Ok(bytes)
}

/// Writes bytes as a file, whole or not at all.
///
/// # Errors
/// What the operating system says.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write_atomically(path, bytes).map_err(|cause| WriteError::Io { path: path.to_owned(), cause })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exr_file_keeps_every_bit() {
        let pixels: Vec<[f32; 3]> = (0..35).map(|k| [k as f32 * 0.1, 1e-20, 1e20 / (k as f32 + 0.3)]).collect();
        let picture = Picture::new(7, 5, pixels.clone()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        picture.write_exr(&path).unwrap();
        let read = exr::prelude::read_first_rgba_layer_from_file(
            &path,
            |size, _| vec![[0.0f32; 3]; size.area()],
            |pixels: &mut Vec<[f32; 3]>, at, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[at.y() * 7 + at.x()] = [r, g, b]
            },
        )
        .unwrap();
        assert_eq!(read.layer_data.channel_data.pixels, pixels);
        assert_eq!(picture.to_exr().unwrap(), picture.to_exr().unwrap());
    }

    #[test]
    fn a_png_file_holds_what_it_is_given() {
        let rgb: Vec<u8> = (0..4 * 3 * 3).map(|k| (k * 7) as u8).collect();
        let bytes = to_png(4, 3, &rgb).unwrap();
        let read = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png).unwrap().into_rgb8();
        assert_eq!((read.dimensions(), read.into_raw()), ((4, 3), rgb.clone()));
        assert!(matches!(to_png(4, 4, &rgb), Err(WriteError::Size { .. })));
    }

    #[test]
    fn a_place_that_cannot_be_written_is_named() {
        let picture = Picture::new(1, 1, vec![[0.0; 3]]).unwrap();
        let message = picture.write_exr(Path::new("/dev/null/a.exr")).unwrap_err().to_string();
        assert!(message.starts_with("/dev/null/a.exr: "), "{message}");
    }
}
