//! From radiance to the 8 bits of a screen.
//!
//! `exrdisplay` is what the study used: the viewer of ILM's OpenEXR viewers (ImageView.cpp, class Gamma). For each channel x, with exposure e
//! in f-stops and power g,
//!
//!   y = x 2^(e + 2.47393);   beyond 1:  y <- 1 + ln(f (y - 1) + 1) / f;   code = 255 2^(-3.5 g) y^g, at most 255
//!
//! f solves ln(f (2^5 - 1) + 1) / f = 2^3.5 - 1, so that the knee takes 2^5 to the brightest code (kneeLow 0, kneeHigh 5, defog 0, the
//! viewer's defaults). Middle grey, x = 0.18, becomes y = 1, 3.5 stops below white.
//!
//! The paper says "a gamma value of 1.25", which may be g = 1 / 1.25 or something else; the viewer's default is g = 1 / 2.2, whose
//! pictures agree better with what people said. g is an option for that reason.
//!
//! `srgb` is the transfer function of IEC 61966-2-1 after 2^e; `none` takes 1 to 255 linearly, after 2^e. Both cut at 1.

use crate::picture::Picture;
use vernis_metric::math::color::srgb;

/// The power of the viewer's default.
pub const DEFAULT_GAMMA: f64 = 1.0 / 2.2;
/// Exposure that takes 0.18 to 1 in `exrdisplay`.
const MIDDLE_GREY: f64 = 2.47393;
/// Stops from middle grey to white.
const HEADROOM: f64 = 3.5;
/// Stops from middle grey to what the knee takes to white.
const KNEE_HIGH: f64 = 5.0;

/// A tone curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tone {
    /// That of ILM's viewer.
    ExrDisplay {
        /// The power g.
        gamma: f64,
    },
    /// The transfer function of sRGB.
    Srgb,
    /// Linear.
    Linear,
}

fn knee(x: f64, f: f64) -> f64 {
    (x * f + 1.0).ln() / f
}

/// f with knee(x, f) = y, by bisection as the viewer does.
fn knee_factor(x: f64, y: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while knee(x, high) > y {
        low = high;
        high *= 2.0;
    }
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if knee(x, middle) < y { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

impl Tone {
    /// The curve of one channel after `exposure` stops: radiance to 0..=1.
    fn curve(self, exposure: f64) -> impl Fn(f64) -> f64 {
        let f = knee_factor(KNEE_HIGH.exp2() - 1.0, HEADROOM.exp2() - 1.0);
        let scale = exposure.exp2();
        move |x: f64| {
            let x = (x * scale).max(0.0);
            let shown = match self {
                Self::ExrDisplay { gamma } => {
                    let y = x * MIDDLE_GREY.exp2();
                    let y = if y > 1.0 { 1.0 + knee(y - 1.0, f) } else { y };
                    y.powf(gamma) * (-HEADROOM * gamma).exp2()
                }
                Self::Srgb => srgb(x),
                Self::Linear => x,
            };
            shown.min(1.0)
        }
    }

    /// 8-bit RGB values of a picture, row by row from the top left. Rounded; the viewer itself dithers.
    pub fn apply(self, picture: &Picture, exposure: f64) -> Vec<u8> {
        let curve = self.curve(exposure);
        picture.pixels().iter().flatten().map(|x| (255.0 * curve(f64::from(*x))).round() as u8).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_viewer_shows_middle_grey_and_white_where_it_says() {
        let shown = |gamma: f64, x: f64| Tone::ExrDisplay { gamma }.curve(0.0)(x);
        // "84.66 (or 3.5 f-stops below the display's maximum intensity)": the comment in the viewer's source.
        assert!((255.0 * shown(DEFAULT_GAMMA, 0.18) - 84.66).abs() < 0.02, "{}", 255.0 * shown(DEFAULT_GAMMA, 0.18));
        for gamma in [DEFAULT_GAMMA, 0.8, 1.25] {
            // Five stops above middle grey is the brightest.
            assert!((shown(gamma, 0.18 * 32.0) - 1.0).abs() < 1e-4);
            assert_eq!(shown(gamma, 1e9), 1.0);
            assert_eq!(shown(gamma, 0.0), 0.0);
        }
        // A stop of exposure is a factor of two, below the knee and beyond.
        for x in [0.01, 0.3, 2.0] {
            assert!((Tone::Srgb.curve(1.0)(x) - Tone::Srgb.curve(0.0)(2.0 * x)).abs() < 1e-12);
        }
        let values: Vec<f64> = (0..2000).map(|k| shown(DEFAULT_GAMMA, 0.005 * f64::from(k))).collect();
        assert!(values.is_sorted());
    }

    #[test]
    fn srgb_is_the_standards() {
        // IEC 61966-2-1: 0.5 linear is code 187.5, 0.0031308 is where the line ends.
        assert!((255.0 * Tone::Srgb.curve(0.0)(0.5) - 187.516).abs() < 1e-2);
        assert!((Tone::Srgb.curve(0.0)(0.003_130_8) - Tone::Srgb.curve(0.0)(0.003_130_9)).abs() < 1e-5);
        let picture = Picture::new(2, 1, vec![[0.0, 0.5, 2.0], [1.0, -1.0, 0.25]]).unwrap();
        assert_eq!(Tone::Srgb.apply(&picture, 0.0), [0, 188, 255, 255, 0, 137]);
        assert_eq!(Tone::Linear.apply(&picture, 0.0), [0, 128, 255, 255, 0, 64]);
    }
}
