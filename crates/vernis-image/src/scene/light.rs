//! Light from infinity: white, or a latitude/longitude picture whose texels are constant.
//!
//! Texel (row i, column j) of H x W is centred at T = (i + 0.5) pi / H from +y and P = (j + 0.5) 2 pi / W, direction
//! (sin T sin P, cos T, -sin T cos P): the frame of [`vernis_metric::light`].

use super::SceneError;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::light::source::{COLUMNS, ProbePicture, ROWS};
use vernis_metric::math::Rgb;

/// Radiance from everywhere, linear RGB.
#[derive(Debug, Clone)]
pub enum Light {
    /// Radiance 1 from everywhere.
    White,
    /// A picture of the surroundings.
    Panorama(Arc<Panorama>),
}

/// A latitude/longitude picture, row by row from +y.
#[derive(Debug, Clone, PartialEq)]
pub struct Panorama {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

impl Panorama {
    /// A picture of `width` times `height` texels.
    ///
    /// # Errors
    /// Says which texel is negative or not finite, that all are black, or that their number is another.
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<Self, String> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(texels.len()) {
            return Err(format!("it has {} texels; {width}x{height} are needed", texels.len()));
        }
        let bad = |texel: &[f32; 3]| !texel.iter().all(|v| v.is_finite() && *v >= 0.0);
        if let Some(k) = texels.iter().position(bad) {
            let (row, column) = (k / width, k % width);
            return Err(format!(
                "the texel in row {row}, column {column} is {:?}; it must be finite and at least 0",
                texels[k]
            ));
        }
        if texels.iter().flatten().all(|v| *v == 0.0) {
            return Err("every texel is 0; at least one must be greater".to_owned());
        }
        Ok(Self { width, height, texels })
    }

    /// A Radiance picture (`.hdr`), as its file has it.
    ///
    /// # Errors
    /// A file that is no such picture, is not twice as wide as high, or has no light.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let ProbePicture { width, height, pixels } = ProbePicture::read(path)?;
        let unfit = |reason: String| SceneError::Probe { path: path.to_owned(), reason };
        if width != 2 * height {
            return Err(unfit(format!(
                "it has {width}x{height} pixels; a latitude/longitude picture must be twice as wide as high"
            )));
        }
        let texels = pixels.into_iter().map(|pixel| pixel.map(|v| v as f32)).collect();
        Self::new(width, height, texels).map_err(unfit)
    }

    /// The lamps that are defined by code ([`vernis_metric::light::source`]): those from number 1 on, mean luminance 3.
    pub fn lamps() -> Self {
        let texels =
            vernis_metric::light::Light::lamps(1).radiance().iter().map(|e: &Rgb| e.map(|v| v as f32)).collect();
        Self { width: COLUMNS, height: ROWS, texels }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Radiance of every texel, row by row from +y.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_gives_no_light_is_refused() {
        let message = |texels: Vec<[f32; 3]>| Panorama::new(2, 1, texels).unwrap_err();
        assert!(message(vec![[1.0; 3]]).contains("it has 1 texels; 2x1 are needed"));
        assert!(message(vec![[0.0; 3]; 2]).contains("every texel is 0"));
        assert!(message(vec![[1.0; 3], [1.0, -1.0, 0.0]]).contains("row 0, column 1"));
        assert!(message(vec![[f32::INFINITY; 3], [1.0; 3]]).contains("must be finite"));
        assert!(Panorama::new(2, 1, vec![[0.0; 3], [1.0; 3]]).is_ok());
    }
}
