//! CID: the color-image-difference measure, an SSIM of lightness with terms for chroma and hue.
//!
//!   CID = 1 - L C S X H,  each factor the mean over the window's places of
//!   L = 1/(c1 (mL1 - mL2)^2 + 1)            lightness
//!   C = (c2 + 2 sL1 sL2)/(c2 + sL1^2 + sL2^2)   contrast of lightness
//!   S = (c3 + sL12)/(c3 + sL1 sL2)           structure of lightness
//!   X = 1/(c4 (mC1 - mC2)^2 + 1)            chroma
//!   H = 1/(c5 (mean dH)^2 + 1)               hue, dH = sqrt(da^2 + db^2 - dC^2)
//!
//! m, s: means and standard deviations under a Gaussian of 11 x 11 pixels, sigma 1.5; c = 0.002, 0.1, 0.1, 0.002, 0.008. Colours:
//! sRGB -> XYZ -> S-CIELAB filters at 40 samples a degree ([`super::s_cielab`]) -> LAB2000HL ([`super::lab2000hl`]).
//!
//! `cid` needs the user's table of LAB2000HL; `cid-cielab` is the same in CIELAB. The constants were chosen for LAB2000HL, so the
//! two are different metrics.
//!
//! Source: Lissner, Preiss, Urban, Scheller Lichtenauer and Zolliker 2013 (doi:10.1109/TIP.2012.2216279), equations 4 to 12, with the
//! default parameters of the authors' program. One of the metrics of Lavoue et al. 2021 (doi:10.1111/cgf.142636).
//!
//! Display: sRGB seen at 40 pixels a degree, fixed. Blind to: contrast of chroma (iCID sees it).

use super::contract::{
    Comparison, Conditions, ImageMetric, ImageMetricError, Need, PreparedResult, Properties, by_features,
};
use super::lab2000hl::{Space, cielab, xyz};
use super::plane::{Edge, Plane, gaussian};
use super::s_cielab;
use crate::picture::{EncodedPicture, MOST_PIXELS};
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Side of the window, pixels.
pub(super) const WINDOW: usize = 11;
/// Standard deviation of its weights, pixels.
const SIGMA: f64 = 1.5;
/// c1 to c5.
const CONSTANTS: [f64; 5] = [0.002, 0.1, 0.1, 0.002, 0.008];

/// CID; in LAB2000HL or in CIELAB.
#[derive(Clone, Copy, Debug)]
pub struct Cid {
    /// Whether colours are compared in CIELAB, which needs no table.
    pub in_cielab: bool,
}

/// The space that `metric` works in.
pub(super) fn space(
    metric: &'static str,
    fallback: &'static str,
    in_cielab: bool,
    conditions: &Conditions,
) -> Result<Space, ImageMetricError> {
    match &conditions.table {
        _ if in_cielab => Ok(Space::Cielab),
        Some(table) => Ok(Space::Lab2000Hl(table.clone())),
        None => {
            let folder = conditions.weights.as_ref().map(|weights| weights.folder().to_owned());
            Err(ImageMetricError::NoTable { metric, fallback, folder })
        }
    }
}

impl ImageMetric for Cid {
    fn name(&self) -> &'static str {
        if self.in_cielab { "cid-cielab" } else { "cid" }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let source = "Lissner et al. 2013, doi:10.1109/TIP.2012.2216279";
        Properties {
            smallest: WINDOW,
            most_pixels: MOST_PIXELS / 4,
            needs: if self.in_cielab { vec![] } else { vec![Need::Lab2000HlTable { fallback: "cid-cielab" }] },
            has_map: false,
            ..Properties::new("color-image difference", "1, 0 to 1", source)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let space = space(self.name(), "cid-cielab", self.in_cielab, conditions)?;
        by_features(reference, move |picture| seen(picture, &space), |a, b, _| compared(a, b))
    }
}

fn seen(picture: &EncodedPicture, space: &Space) -> Seen {
    let filtered = s_cielab::filtered(&xyz(picture), picture.width());
    let colours = parallel::map_items(&filtered, |c| space.of_cielab(cielab(*c)));
    Seen::new(&colours, picture.width(), &gaussian(WINDOW, SIGMA))
}

fn compared(a: &Seen, b: &Seen) -> Comparison {
    let terms = a.terms(b, &gaussian(WINDOW, SIGMA));
    let [c1, c2, c3, c4, c5] = CONSTANTS;
    let factor = |value: &(dyn Fn(&Term) -> f64 + Sync)| terms.map(value).mean();
    let factors = [
        ("lightness", factor(&|t| 1.0 / (c1 * t.lightness.powi(2) + 1.0))),
        ("contrast", factor(&|t| (c2 + 2.0 * t.sl1 * t.sl2) / (c2 + t.sl1.powi(2) + t.sl2.powi(2)))),
        ("structure", factor(&|t| (c3 + t.sl12) / (c3 + t.sl1 * t.sl2))),
        ("chroma", factor(&|t| 1.0 / (c4 * t.chroma.powi(2) + 1.0))),
        ("hue", factor(&|t| 1.0 / (c5 * t.hue.powi(2) + 1.0))),
    ];
    let quality = 1.0 - factors.iter().map(|(_, f)| f).product::<f64>();
    Comparison { distance: quality, quality, details: factors.to_vec(), map: None }
}

/// A picture as CID and iCID see it, with the moments of it alone.
pub(super) struct Seen {
    lightness: Plane,
    chroma: Plane,
    a: Plane,
    b: Plane,
    mean_lightness: Plane,
    mean_chroma: Plane,
    deviation_lightness: Plane,
    deviation_chroma: Plane,
}

impl Seen {
    /// Of lightness, a and b of every pixel.
    pub fn new(colours: &[[f64; 3]], width: usize, window: &[f64]) -> Self {
        let [lightness, a, b] = [0, 1, 2].map(|k| Plane::of_pixels(width, colours, |c| c[k]));
        let chroma = Plane::of_two(&a, &b, |a, b| (a * a + b * b).sqrt());
        let mean = |plane: &Plane| plane.correlate(window, window, Edge::Valid);
        let deviation = |plane: &Plane, mean_of: &Plane| {
            Plane::of_two(&mean(&plane.map(|v| v * v)), mean_of, |square, mean| (square - mean * mean).max(0.0).sqrt())
        };
        let (mean_lightness, mean_chroma) = (mean(&lightness), mean(&chroma));
        let deviation_lightness = deviation(&lightness, &mean_lightness);
        let deviation_chroma = deviation(&chroma, &mean_chroma);
        Self { lightness, chroma, a, b, mean_lightness, mean_chroma, deviation_lightness, deviation_chroma }
    }

    /// What the maps are made of.
    pub fn terms<'a>(&'a self, test: &'a Self, window: &[f64]) -> Terms<'a> {
        let mean = |plane: &Plane| plane.correlate(window, window, Edge::Valid);
        let product = |a: &Plane, b: &Plane| mean(&Plane::of_two(a, b, |a, b| a * b));
        let width = self.a.width;
        let hue = Plane::by_rows(width, self.a.height, |y, row| {
            for (x, hue) in row.iter_mut().enumerate() {
                let i = y * width + x;
                let d = |plane: &Plane, other: &Plane| plane.values[i] - other.values[i];
                let (a, b, chroma) = (d(&self.a, &test.a), d(&self.b, &test.b), d(&self.chroma, &test.chroma));
                // Rounding may make it negative.
                *hue = (a * a + b * b - chroma * chroma).max(0.0).sqrt();
            }
        });
        Terms {
            reference: self,
            test,
            product_lightness: product(&self.lightness, &test.lightness),
            product_chroma: product(&self.chroma, &test.chroma),
            hue: mean(&hue),
        }
    }
}

/// The moments of two pictures.
pub(super) struct Terms<'a> {
    reference: &'a Seen,
    test: &'a Seen,
    product_lightness: Plane,
    product_chroma: Plane,
    hue: Plane,
}

/// Those at one place of the window: differences of means, standard deviations and covariances.
pub(super) struct Term {
    pub lightness: f64,
    pub chroma: f64,
    pub hue: f64,
    pub sl1: f64,
    pub sl2: f64,
    pub sl12: f64,
    pub sc1: f64,
    pub sc2: f64,
    pub sc12: f64,
}

impl Terms<'_> {
    /// A value for every place of the window.
    pub fn map(&self, value: impl Fn(&Term) -> f64 + Sync) -> Plane {
        let (width, height) = (self.hue.width, self.hue.height);
        let (r, t) = (self.reference, self.test);
        Plane::by_rows(width, height, |y, row| {
            for (x, out) in row.iter_mut().enumerate() {
                let i = y * width + x;
                let (ml1, ml2) = (r.mean_lightness.values[i], t.mean_lightness.values[i]);
                let (mc1, mc2) = (r.mean_chroma.values[i], t.mean_chroma.values[i]);
                *out = value(&Term {
                    lightness: ml1 - ml2,
                    chroma: mc1 - mc2,
                    hue: self.hue.values[i],
                    sl1: r.deviation_lightness.values[i],
                    sl2: t.deviation_lightness.values[i],
                    sl12: self.product_lightness.values[i] - ml1 * ml2,
                    sc1: r.deviation_chroma.values[i],
                    sc2: t.deviation_chroma.values[i],
                    sc12: self.product_chroma.values[i] - mc1 * mc2,
                });
            }
        })
    }
}
