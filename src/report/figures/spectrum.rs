//! The energy of light probes by degree of spherical harmonics, as figure 8 of Lavoué et al. 2021 has it.

use super::marks::{Anchor, BLUE, Canvas, Drawn, FAINT, INK, ORANGE, Picture};
use super::{Axis, TEXT, TITLE, WIDTH, figure};
use crate::report::{Figure, ReportError};
use plotters::prelude::DrawingBackend;

/// The energies of one probe: its name, and its share of energy by degree from 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Name of the light probe.
    pub name: String,
    /// Share of the energy of the whole map by degree of spherical harmonics from 0; sums to 1 but for what lies beyond the last.
    pub shares: Vec<f64>,
}

/// `None` where there is no probe.
///
/// # Errors
/// [`ReportError::Figure`].
pub fn figure_of(spectra: &[Spectrum]) -> Result<Option<Figure>, ReportError> {
    if spectra.is_empty() {
        return Ok(None);
    }
    let below = |s: &Spectrum| {
        let share = 100.0 * s.shares.iter().sum::<f64>();
        format!("{} holds {share:.1} % of its energy up to degree {}", s.name, s.shares.len().saturating_sub(1))
    };
    let caption = format!(
        "Share of the energy of each whole light probe, its mean square over the sphere, by degree of spherical harmonics; the \
         steeper the line falls, the softer the light. {}; the rest lies beyond. Both axes are logarithmic; degree 0, the mean, is \
         left out.",
        spectra.iter().map(below).collect::<Vec<_>>().join(", ")
    );
    figure("light-probes", caption, &Lines { spectra }).map(Some)
}

struct Lines<'a> {
    spectra: &'a [Spectrum],
}

const LOWEST: f64 = -5.0;

impl Picture for Lines<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, 560)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let degrees = self.spectra.iter().map(|s| s.shares.len()).max().unwrap_or(2).max(3);
        let x = Axis { data: (0.0, ((degrees - 1) as f64).log10()), pixels: (70.0, 640.0) };
        let y = Axis { data: (LOWEST, 0.0), pixels: (490.0, 70.0) };
        canvas.words("Energy of the light probes by degree", (20.0, 24.0), TITLE, Anchor::Left)?;
        for decade in y.ticks(1.0) {
            canvas.line((x.pixels.0, y.at(decade)), (x.pixels.1, y.at(decade)), FAINT, 1.0)?;
            let label = if decade == 0.0 { "1".to_owned() } else { format!("1e{decade}") };
            canvas.words(&label, (60.0, y.at(decade)), TEXT, Anchor::Right)?;
        }
        for degree in [1usize, 2, 5, 10, 20, 50, 100].into_iter().filter(|d| *d < degrees) {
            let at = x.at((degree as f64).log10());
            canvas.line((at, y.pixels.0), (at, y.pixels.1), FAINT, 1.0)?;
            canvas.words(&degree.to_string(), (at, 508.0), TEXT, Anchor::Middle)?;
        }
        canvas.words("degree", (x.pixels.1, 536.0), TEXT, Anchor::Right)?;
        for (i, spectrum) in self.spectra.iter().enumerate() {
            let point = |(l, share): (usize, &f64)| {
                (x.at((l as f64).log10()), y.at(share.max(1e-300).log10().clamp(LOWEST, 0.0)))
            };
            let points: Vec<(f64, f64)> = spectrum.shares.iter().enumerate().skip(1).map(point).collect();
            // In grey: a thick line and a thin one.
            let (colour, width) = [(BLUE, 3.0), (ORANGE, 1.5), (INK, 1.0)][i % 3];
            canvas.path(&points, colour, width)?;
            let top = 90.0 + 26.0 * i as f64;
            canvas.path(&[(660.0, top), (690.0, top)], colour, width)?;
            canvas.words(&spectrum.name, (698.0, top), TEXT, Anchor::Left)?;
        }
        Ok(())
    }
}
