//! What metrics are given: a picture as its file holds it, and what its numbers mean.

use super::{Picture, PictureError};

/// Pixels of the largest picture that is read or compared: 8K UHD (7680 x 4320) fits.
pub const MOST_PIXELS: usize = 1 << 25;

/// Brightest linear value, in cd/m2: the disc of the Sun has 1.6e9.
pub const BRIGHTEST: f32 = 1e10;

/// What the numbers of a picture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Codes of sRGB (IEC 61966-2-1), 0 to 255: what a display is sent. Codes of 16 bits are divided by 257.
    Srgb,
    /// Linear light with the primaries of BT.709, in cd/m2.
    Linear,
}

impl Encoding {
    /// In words, for messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Srgb => "sRGB codes (of a PNG or JPEG)",
            Self::Linear => "linear light (of an EXR, HDR or PFM)",
        }
    }
}

/// A picture of three channels as its file holds it, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedPicture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    encoding: Encoding,
}

impl EncodedPicture {
    /// A picture of `width` times `height` pixels.
    ///
    /// # Errors
    /// [`PictureError::Size`] for a side of zero, another number of pixels or more than [`MOST_PIXELS`];
    /// [`PictureError::Value`] for a value that is no number, negative, or above 255 (codes) or [`BRIGHTEST`] (light).
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>, encoding: Encoding) -> Result<Self, PictureError> {
        check_size(width, height)?;
        if pixels.len() != width * height {
            return Err(PictureError::Count { width, height, found: pixels.len() });
        }
        let (most, unit) = match encoding {
            Encoding::Srgb => (255.0, ""),
            Encoding::Linear => (BRIGHTEST, " cd/m2"),
        };
        let wrong = pixels.iter().enumerate().find_map(|(i, pixel)| {
            let channel = pixel.iter().position(|v| !(0.0..=most).contains(v))?;
            Some((i, channel, pixel[channel]))
        });
        if let Some((i, channel, value)) = wrong {
            let channel = ["red", "green", "blue"][channel];
            return Err(PictureError::Value { x: i % width, y: i / width, channel, value, most, unit });
        }
        Ok(Self { width, height, pixels, encoding })
    }

    /// A rendered picture, whose linear values are cd/m2.
    ///
    /// # Errors
    /// Those of [`EncodedPicture::new`].
    pub fn of_light(picture: &Picture) -> Result<Self, PictureError> {
        Self::new(picture.width(), picture.height(), picture.pixels().to_vec(), Encoding::Linear)
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// RGB of every pixel, row by row from the top left.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// What the numbers mean.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }
}

/// That a picture of this size can be held.
pub(crate) fn check_size(width: usize, height: usize) -> Result<(), PictureError> {
    let pixels = width.checked_mul(height);
    if width > 0 && height > 0 && pixels.is_some_and(|n| n <= MOST_PIXELS) {
        return Ok(());
    }
    Err(PictureError::Size { width, height })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(width: usize, height: usize, pixels: Vec<[f32; 3]>, encoding: Encoding) -> String {
        EncodedPicture::new(width, height, pixels, encoding).unwrap_err().to_string()
    }

    #[test]
    fn sizes_and_values_are_checked() {
        let size = refused(0, 3, vec![], Encoding::Srgb);
        assert_eq!(size, "it has 0 x 3 pixels; each side must be at least 1, and there may be at most 33554432 pixels");
        assert!(refused(1 << 20, 1 << 20, vec![], Encoding::Srgb).starts_with("it has 1048576 x 1048576 pixels;"));
        assert!(refused(usize::MAX, 2, vec![], Encoding::Srgb).contains("at most 33554432"));
        assert_eq!(refused(2, 2, vec![[0.0; 3]], Encoding::Srgb), "1 pixel was given for 2 x 2");
        let mut pixels = vec![[0.5; 3]; 6];
        pixels[4][1] = -0.25;
        let negative = refused(3, 2, pixels.clone(), Encoding::Linear);
        assert_eq!(negative, "pixel (1, 1) has green -0.25; it must be from 0 to 1e10 cd/m2");
        pixels[4][1] = f32::NAN;
        assert!(refused(3, 2, pixels.clone(), Encoding::Linear).contains("green NaN;"));
        pixels[4][1] = f32::INFINITY;
        assert!(refused(3, 2, pixels.clone(), Encoding::Linear).contains("green inf;"));
        pixels[4][1] = 256.0;
        assert!(EncodedPicture::new(3, 2, pixels.clone(), Encoding::Linear).is_ok());
        assert_eq!(refused(3, 2, pixels, Encoding::Srgb), "pixel (1, 1) has green 256; it must be from 0 to 255");
    }
}
