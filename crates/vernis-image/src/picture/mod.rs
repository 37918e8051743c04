//! Pictures: linear RGB pixels, what metrics are given, and the files that hold them.

mod encoded;
mod error;
pub mod read;
pub mod write;

pub use encoded::{BRIGHTEST, EncodedPicture, Encoding, MOST_PIXELS};
pub use error::{PictureError, ReadError};

/// A picture of linear RGB values, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of `width` times `height` pixels; `None` where a side is zero or the number of pixels is another.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Option<Self> {
        let fits = width > 0 && height > 0 && width.checked_mul(height) == Some(pixels.len());
        fits.then_some(Self { width, height, pixels })
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Linear RGB of every pixel, row by row from the top left.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }
}
