//! Which descriptors a metric uses: named families, in order.

use super::embedding::Embedding;
use super::features::{BrdfFeatures, Derived};
use super::names::{ABSOLUTE_REGIONS, CONTEXT, DISPLAY, LIGHTS, NORMS, SIGNED_REGIONS, SLOT, SLOT_DETAIL};
use super::regions::{REGIONS, region, region_limits, region_name};
use super::{DescriptorError, Setup, comparison, v1, wasserstein};
use crate::descriptor::{Column, Role};
use serde::{Deserialize, Serialize};

const OPPONENT: &str = "20 ln units of the opponent log space";
const LOG: &str = "ln";
const ONE: &str = "1";
const PERCENT: &str = "% of the screen's range, after the power law";
const SSIM: &str = "Wang et al. 2004, doi:10.1109/TIP.2003.819861";
const RENDERING: &str = "Kajiya 1986, doi:10.1145/15886.15902, applied as a linear operator";
const HALF_DIFFERENCE: &str = "Rusinkiewicz 1998, doi:10.1007/978-3-7091-6453-2_2";

/// One descriptor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// Name, family and role.
    pub column: Column,
    /// Unit of its values, `"1"` where they have none.
    pub unit: &'static str,
    /// One line.
    pub meaning: String,
    /// What it builds on.
    pub source: &'static str,
}

/// A family of descriptors defined by code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Family {
    /// Pictures under lamps, 18.
    Lights,
    /// Pictures under the slot, 6.
    Slot,
    /// Log ratios over angular regions, the 14 of compact 48.
    Angular,
    /// The reference alone, 10.
    Context,
    /// Further descriptors of the picture under the slot, 8.
    SlotDetail,
    /// Pictures as a screen shows them, 12.
    Display,
    /// How the numbers of the context change from reference to candidate, 10.
    Change,
    /// Log ratios of luminance and chroma over all 32 angular regions, 128.
    AngularFull,
    /// Distances of value distributions, 4.
    Wasserstein,
    /// Those of the other families that are norms of a difference, not rounded off at 0, 18. Each is a pseudo-metric.
    Norms,
}

impl Family {
    /// All families, those of compact 48 first.
    pub const ALL: [Self; 10] = [
        Self::Lights,
        Self::Slot,
        Self::Angular,
        Self::Context,
        Self::SlotDetail,
        Self::Display,
        Self::Change,
        Self::AngularFull,
        Self::Wasserstein,
        Self::Norms,
    ];

    /// Those of the extended set, in order.
    pub const EXTENDED: [Self; 7] =
        [Self::Lights, Self::Slot, Self::Angular, Self::Context, Self::SlotDetail, Self::Display, Self::Change];

    /// The name that columns and ablations use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lights => "lights",
            Self::Slot => "slot",
            Self::Angular => "angular",
            Self::Context => "context",
            Self::SlotDetail => "slot-detail",
            Self::Display => "display",
            Self::Change => "change",
            Self::AngularFull => "angular-full",
            Self::Wasserstein => "wasserstein",
            Self::Norms => "norms",
        }
    }

    /// The family called `name`.
    pub fn named(name: &str) -> Result<Self, DescriptorError> {
        Self::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| DescriptorError::UnknownFamily {
            name: name.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }

    /// Its descriptors in order.
    pub fn descriptions(self) -> Vec<Description> {
        let describe = |name: String, unit, meaning: String, source| Description {
            column: Column {
                name: format!("{}.{name}", self.name()),
                family: self.name().to_owned(),
                role: if self == Self::Context { Role::Context } else { Role::Difference },
            },
            unit,
            meaning,
            source,
        };
        let picture = |light: &str, name: &&str| {
            let (unit, meaning, source) = picture_meaning(name);
            describe((*name).to_owned(), unit, format!("{meaning}, {light}"), source)
        };
        let ratio = |kind: &str, region: usize| {
            let [h0, h1, d0, d1] = region_limits(region);
            let place = format!("theta_h {h0} to {h1}, theta_d {d0} to {d1} deg");
            let what = match kind {
                "sY" => "mean log ratio of luminance",
                "aY" => "mean absolute log ratio of luminance",
                "sR" => "mean difference of ln(R/G)",
                _ => "mean difference of ln(B/G)",
            };
            describe(format!("{kind}.{}", region_name(region)), LOG, format!("{what}, {place}"), HALF_DIFFERENCE)
        };
        let named = |kind: &'static str, names: &[&str]| -> Vec<Description> {
            names.iter().filter_map(|r| region(r)).map(|r| ratio(kind, r)).collect()
        };
        match self {
            Self::Lights => LIGHTS.iter().map(|n| picture("mean over three layouts of lamps", n)).collect(),
            Self::Slot => SLOT.iter().map(|n| picture("under a broad overhead light", n)).collect(),
            Self::Angular => [named("sY", &SIGNED_REGIONS), named("aY", &ABSOLUTE_REGIONS)].concat(),
            Self::Context => {
                CONTEXT.iter().map(|n| describe((*n).to_owned(), LOG, context_meaning(n), HALF_DIFFERENCE)).collect()
            }
            Self::SlotDetail => SLOT_DETAIL.iter().map(|n| picture("under a broad overhead light", n)).collect(),
            Self::Display => [("lamps", "mean over three layouts of lamps"), ("slot", "under a broad overhead light")]
                .into_iter()
                .flat_map(|(light, under)| DISPLAY.map(|n| (light, under, n)))
                .map(|(light, under, n)| {
                    let (unit, meaning) = display_meaning(n);
                    describe(format!("{light}.{n}"), unit, format!("{meaning}, {under}"), RENDERING)
                })
                .collect(),
            Self::Change => CONTEXT
                .iter()
                .map(|n| describe((*n).to_owned(), LOG, format!("change of: {}", context_meaning(n)), HALF_DIFFERENCE))
                .collect(),
            Self::AngularFull => {
                (0..REGIONS).flat_map(|r| ["sY", "aY", "sR", "sB"].map(|kind| ratio(kind, r))).collect()
            }
            Self::Wasserstein => wasserstein::NAMES
                .iter()
                .map(|n| {
                    let meaning = format!("1-Wasserstein distance of the values' distributions, channel {n}");
                    describe((*n).to_owned(), "(1/sr)^(1/4)", meaning, "Villani 2003, remark 2.19 iii")
                })
                .collect(),
            Self::Norms => {
                let others =
                    [Self::Lights, Self::Slot, Self::SlotDetail, Self::Display, Self::Angular].map(Self::descriptions);
                let found = |name: &&str| others.iter().flatten().find(|d| d.column.name == *name);
                let plain = |d: &Description| {
                    describe(d.column.name.clone(), d.unit, format!("{}, not rounded off at 0", d.meaning), d.source)
                };
                NORMS.iter().filter_map(found).map(plain).collect()
            }
        }
    }
}

fn picture_meaning(name: &str) -> (&'static str, &'static str, &'static str) {
    match name {
        "dE" => (OPPONENT, "mean difference of the pictures", RENDERING),
        "dE4" => (OPPONENT, "fourth-power mean of the difference of the pictures", RENDERING),
        "adL" => (OPPONENT, "mean absolute difference of lightness", RENDERING),
        "dC" => (OPPONENT, "mean chroma difference", RENDERING),
        "sL" => (OPPONENT, "signed mean difference of lightness", RENDERING),
        "mC" => (OPPONENT, "length of the mean chroma shift", RENDERING),
        "sStd" => (LOG, "log ratio of the deviations of lightness", RENDERING),
        "corr" => (ONE, "1 - correlation of lightness", SSIM),
        "rms0" => (OPPONENT, "deviation of the lightness difference", RENDERING),
        "q0-15" => (OPPONENT, "shift of the darkest quarter's lightness", RENDERING),
        "q16-47" => (OPPONENT, "shift of the middle half's lightness", RENDERING),
        "q48-59" => (OPPONENT, "shift of the lightness between the 75th and 94th percentile", RENDERING),
        "w1" => (OPPONENT, "mean absolute shift of the quantiles of lightness", RENDERING),
        "q60-63" => (OPPONENT, "shift of the brightest sixteenth's lightness", RENDERING),
        "struct0" => (ONE, "1 - local structure agreement", SSIM),
        "contrast0" => (ONE, "1 - local contrast agreement", SSIM),
        "localstd0" => (LOG, "log ratio of the mean local deviations", SSIM),
        "localstd2" => (LOG, "log ratio of the mean local deviations at a quarter of the resolution", SSIM),
        _ => (OPPONENT, "mean absolute difference of local means at an eighth of the resolution", SSIM),
    }
}

fn display_meaning(name: &str) -> (&'static str, &'static str) {
    match name {
        "lin" => (LOG, "log ratio of the mean luminance"),
        "max" => (LOG, "log ratio of the luminance of the brightest hundredth"),
        "rms" => (PERCENT, "root mean square difference on a screen"),
        "mean" => (PERCENT, "mean difference on a screen"),
        "corr" => (ONE, "1 - correlation of the lightness on a screen"),
        _ => (LOG, "log ratio of the deviations of the lightness on a screen"),
    }
}

fn context_meaning(name: &str) -> String {
    match name.rsplit_once('.') {
        Some(("cx", region)) => match self::region(region).map(region_limits) {
            Some([h0, h1, d0, d1]) => {
                format!("mean ln luminance of the reference, theta_h {h0} to {h1}, theta_d {d0} to {d1} deg")
            }
            None => "mean ln luminance of the reference".to_owned(),
        },
        Some((_, fall)) => format!("ln(theta_h + 0.3 deg) where the reference's highlight has fallen by {fall}"),
        None if name == "cxalb" => "ln luminance albedo of the reference at normal incidence".to_owned(),
        None if name == "cxalb60" => "ln luminance albedo of the reference at 60 deg".to_owned(),
        None => "ln energy of the reference's highlight above its diffuse floor".to_owned(),
    }
}

/// An ordered list of families, with learned embeddings after them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DescriptorSet {
    families: Vec<Family>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    embeddings: Vec<Embedding>,
}

impl DescriptorSet {
    /// Compact 48.
    pub fn compact() -> Self {
        Self::new(vec![Family::Lights, Family::Slot, Family::Angular, Family::Context])
    }

    /// Compact 48, the slot in detail, the display and the change of context: 78.
    pub fn extended() -> Self {
        Self::new(Family::EXTENDED.to_vec())
    }

    /// The extended set and the norms, 96: what metrics of version 2 take.
    pub fn with_norms() -> Self {
        Self::new(Family::EXTENDED.into_iter().chain([Family::Norms]).collect())
    }

    /// Every family that needs no learned data.
    pub fn all() -> Self {
        Self::new(Family::ALL.to_vec())
    }

    /// A set of these families, without embeddings.
    pub fn new(families: Vec<Family>) -> Self {
        Self { families, embeddings: vec![] }
    }

    /// This set and the coordinates of an embedding.
    pub fn with_embedding(mut self, embedding: Embedding) -> Self {
        self.embeddings.push(embedding);
        self
    }

    /// The families in order.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// The learned embeddings in order; their columns follow those of the families.
    pub fn embeddings(&self) -> &[Embedding] {
        &self.embeddings
    }

    /// Name, unit, meaning and source of every descriptor, in order.
    pub fn descriptions(&self) -> Vec<Description> {
        let embedded = self.embeddings.iter().flat_map(|e| {
            (0..e.dimension()).map(|k| Description {
                column: Column {
                    name: format!("{}.{k}", e.parts().name),
                    family: e.parts().name.clone(),
                    role: Role::Difference,
                },
                unit: ONE,
                meaning: format!("difference of coordinate {k} of the learned embedding"),
                source: "Nielsen et al. 2015, doi:10.1145/2816795.2818085",
            })
        });
        self.families.iter().flat_map(|f| f.descriptions()).chain(embedded).collect()
    }

    /// The columns of a feature matrix, in order.
    pub fn columns(&self) -> Vec<Column> {
        self.descriptions().into_iter().map(|d| d.column).collect()
    }

    /// The descriptors of `candidate` against `reference`, in the order of [`DescriptorSet::columns`]. All finite; those
    /// that compare are exactly 0 where both are the same.
    ///
    /// # Panics
    /// If one of the two was not computed under the version of `setup`.
    pub fn compare(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures, setup: &Setup) -> Vec<f64> {
        let frame = setup.frame();
        let found = match (&reference.derived, &candidate.derived) {
            (Derived::V1(a), Derived::V1(b)) => {
                v1::compare(&self.families, (reference.table(), a), (candidate.table(), b), frame)
            }
            (Derived::V2(a), Derived::V2(b)) => {
                comparison::compare(&self.families, (&reference.stored, a), (&candidate.stored, b), frame)
            }
            _ => panic!("reference and candidate are features of different versions"),
        };
        let mut out = Vec::new();
        for (family, values) in self.families.iter().zip(found) {
            match family {
                Family::Wasserstein => out.extend(reference.quantiles.distances(&candidate.quantiles)),
                _ => out.extend(values),
            }
        }
        for embedding in &self.embeddings {
            out.extend(embedding.differences(reference.table(), candidate.table()));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::regions::{BANDS, BINS};
    use std::collections::BTreeSet;

    #[test]
    fn all_names_differ() {
        assert_eq!(DescriptorSet::compact().columns().len(), 48);
        let all = DescriptorSet::all().columns();
        assert_eq!(all.iter().map(|c| &c.name).collect::<BTreeSet<_>>().len(), all.len());
        assert_eq!(DescriptorSet::extended().columns().len(), 78);
        assert_eq!(all.len(), 78 + 4 * BINS_AND_BANDS + 4 + 18);
        let context = all.iter().filter(|c| c.role == Role::Context).count();
        assert_eq!(context, 10);
    }

    const BINS_AND_BANDS: usize = BINS * BANDS.len();

    #[test]
    fn families_are_found_by_name() {
        for family in Family::ALL {
            assert_eq!(Family::named(family.name()).unwrap(), family);
        }
        let error = Family::named("light").unwrap_err().to_string();
        assert!(error.contains("light") && error.contains("lights, slot"), "{error}");
    }
}
