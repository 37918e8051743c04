//! Names of the Lp metrics: nine formulas and a correct CIELAB, each in four forms.

use std::fmt;
use std::str::FromStr;

/// What is summed over the cells; the formulas stand in the documentation of [`crate::metric::lp`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Formula {
    /// `sqrt(mean d^2)`.
    D1,
    /// `sqrt(mean (d cos theta_i)^2)`.
    D2,
    /// `sqrt(mean cbrt((d cos theta_i)^2))`.
    D3,
    /// `sqrt(mean d^2 cos theta_o sin theta_o)`.
    D4,
    /// `mean abs(d)`.
    D5,
    /// The colour difference of the authors' program, which is not CIELAB.
    D6,
    /// `mean cbrt((d c)^2)`.
    D7,
    /// `mean abs(l)`.
    D8,
    /// `sqrt(mean l^2)`.
    D9,
    /// CIELAB as the CIE defines it. Not one of the study's metrics.
    Lab,
}

impl Formula {
    /// The nine of the study, then the correct CIELAB; `formula as usize` is the place in this list.
    pub const ALL: [Self; 10] =
        [Self::D1, Self::D2, Self::D3, Self::D4, Self::D5, Self::D6, Self::D7, Self::D8, Self::D9, Self::Lab];

    fn name(self) -> &'static str {
        ["D1", "D2", "D3", "D4", "D5", "D6", "D7", "D8", "D9", "lab"][self as usize]
    }

    /// One line for lists.
    pub(super) fn summary(self) -> &'static str {
        match self {
            Self::D1 => "root mean square difference",
            Self::D2 => "root mean square difference times cos theta_i",
            Self::D3 => "root mean of the cube root of the squared difference times cos theta_i",
            Self::D4 => "root mean square difference weighted by cos theta_o sin theta_o",
            Self::D5 => "mean absolute difference",
            Self::D6 => "colour difference of the study's program (a defective CIELAB), projected-area weighted",
            Self::D7 => "mean cube root of the squared, cosine-weighted difference",
            Self::D8 => "mean absolute log ratio of the cosine-weighted values",
            Self::D9 => "root mean square log ratio of the cosine-weighted values",
            Self::Lab => "CIELAB difference, projected-area weighted",
        }
    }

    /// The sum is a plain one over channels, so that every channel has a distance of its own.
    pub fn has_channels(self) -> bool {
        !matches!(self, Self::D6 | Self::Lab)
    }
}

/// One Lp metric: a formula, with or without clamping (`.Cl`) and cube root (`.CR`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LpVariant {
    /// What is summed over the cells.
    pub formula: Formula,
    /// Only polar angles below 80 degrees take part.
    pub clamped: bool,
    /// The cube root is taken first.
    pub cube_root: bool,
}

impl LpVariant {
    /// Number of variants: [`LpVariant::every`] yields so many.
    pub const COUNT: usize = 4 * Formula::ALL.len();

    /// The variant of `formula` with or without clamping and cube root.
    pub const fn new(formula: Formula, clamped: bool, cube_root: bool) -> Self {
        Self { formula, clamped, cube_root }
    }

    /// The study's 36 variants and the four forms of the correct CIELAB, in the order of [`LpVariant::index`].
    pub fn every() -> impl Iterator<Item = Self> {
        Formula::ALL.into_iter().flat_map(|formula| {
            [(false, false), (true, false), (false, true), (true, true)].map(|(clamped, cube_root)| Self {
                formula,
                clamped,
                cube_root,
            })
        })
    }

    /// The 36 variants of the study: `D1`, `D1.Cl`, `D1.CR`, `D1.Cl.CR`, `D2` and so on.
    pub fn of_study() -> impl Iterator<Item = Self> {
        Self::every().filter(|v| v.formula != Formula::Lab)
    }

    /// Place in [`LpVariant::every`].
    pub fn index(self) -> usize {
        4 * self.formula as usize + 2 * usize::from(self.cube_root) + usize::from(self.clamped)
    }

    /// 1/sr to the power that the formula leaves, or `"1"`.
    pub fn unit(self) -> &'static str {
        match (self.formula, self.cube_root) {
            (Formula::D6 | Formula::D8 | Formula::D9 | Formula::Lab, _) => "1",
            (Formula::D1 | Formula::D2 | Formula::D4 | Formula::D5, false) => "1/sr",
            (Formula::D1 | Formula::D2 | Formula::D4 | Formula::D5, true) => "sr^(-1/3)",
            (Formula::D3, false) => "sr^(-1/3)",
            (Formula::D3, true) => "sr^(-1/9)",
            (Formula::D7, false) => "sr^(-2/3)",
            (Formula::D7, true) => "sr^(-2/9)",
        }
    }
}

impl fmt::Display for LpVariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let clamped = if self.clamped { ".Cl" } else { "" };
        let cube_root = if self.cube_root { ".CR" } else { "" };
        write!(f, "{}{clamped}{cube_root}", self.formula.name())
    }
}

/// The text is not the name of an Lp variant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not an Lp metric: D1 to D9 or lab, then optionally .Cl, then optionally .CR")]
pub struct NotAnLpVariant(pub String);

impl FromStr for LpVariant {
    type Err = NotAnLpVariant;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::every().find(|v| v.to_string() == text).ok_or_else(|| NotAnLpVariant(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_indices_count_up() {
        for (index, variant) in LpVariant::every().enumerate() {
            assert_eq!(variant.index(), index);
            assert_eq!(variant.to_string().parse(), Ok(variant));
        }
        assert_eq!(LpVariant::every().count(), LpVariant::COUNT);
        assert_eq!(LpVariant::of_study().count(), 36);
        assert_eq!(LpVariant::new(Formula::D9, true, true).to_string(), "D9.Cl.CR");
        assert!("D9.CR.Cl".parse::<LpVariant>().is_err());
    }
}
