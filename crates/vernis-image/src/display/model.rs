//! Displays as metrics model them: how much light a code becomes, and how large a pixel is.

use crate::picture::Encoding;
use std::fmt;

/// Light of the simplest display, which HDR-VDP-2 and PU21 assume: white at 100 cd/m2, 1 cd/m2 of which is there for black too.
const STANDARD_PEAK: f64 = 100.0;
const STANDARD_BLACK: f64 = 1.0;

/// Light of the standard display in cd/m2: 99 x + 1 of the linear light x, 0 to 1, of codes; light stays as it is.
pub(crate) fn standard_luminance(linear: f64, encoding: Encoding) -> f64 {
    match encoding {
        Encoding::Srgb => (STANDARD_PEAK - STANDARD_BLACK) * linear + STANDARD_BLACK,
        Encoding::Linear => linear,
    }
}

/// A display of ColorVideoVDP, for the metrics that need one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Display {
    /// 24 inches, 1920 x 1080, 200 cd/m2, contrast 1000, in 250 lux, seen from 0.6 m: 37.8 pixels a degree. sRGB codes.
    StandardFhd,
    /// 30 inches, 3840 x 2160, 200 cd/m2, contrast 1000, in 250 lux, seen from 0.75 m: 75.4 pixels a degree. sRGB codes.
    Standard4k,
    /// 30 inches, 3840 x 2160, 1500 cd/m2, contrast 1,000,000, in 10 lux, seen from 0.75 m: 75.4 pixels a degree. Light in cd/m2,
    /// clipped at 1500.
    StandardHdrLinear,
}

impl Display {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::StandardFhd, Self::Standard4k, Self::StandardHdrLinear];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::StandardFhd => "standard-fhd",
            Self::Standard4k => "standard-4k",
            Self::StandardHdrLinear => "standard-hdr-linear",
        }
    }

    /// The display called so.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|display| display.name() == name)
    }

    /// What it shows.
    pub fn shows(self) -> Encoding {
        match self {
            Self::StandardFhd | Self::Standard4k => Encoding::Srgb,
            Self::StandardHdrLinear => Encoding::Linear,
        }
    }

    /// The display that is assumed where none is named.
    pub fn default_for(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Srgb => Self::StandardFhd,
            Encoding::Linear => Self::StandardHdrLinear,
        }
    }
}

impl fmt::Display for Display {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
