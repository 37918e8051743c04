//! What moves mean opinion scores: material types, methods, illuminations. Sections 5.3 to 5.5 of Lavoue et al. 2021.
//!
//! Comparisons of types and methods are under the illumination with the most stimuli, so that no pair counts twice;
//! hidden references are compared among themselves. What compares models is in `models`.

mod models;

use super::analysis::{Notes, Options, mean, means_and_variances};
use super::anova::{Anova, Factor, anova};
use super::box_plot::BoxPlot;
use super::error::StudyError;
use super::record::{BoxSet, IlluminationComparison, NamedBox, RatedStimulus, TypeComparison};
use super::sos::{self, SosFit};
use super::t_test::{TTest, paired, welch};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::correlation::{Ranking, pearson, pearson_counted, spearman, spearman_counted};
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::math::resampling::{self, Resamples, rows_by_name};

const TYPE: &str = "material type";
const METHOD: &str = "method";
/// A method's family: fits of one model have one.
const MODEL: &str = "model";
const ILLUMINATION: &str = "illumination";
const STEP: &str = "step";
/// Samples of a manifold at growing distances from the reference: section 3.3.
const MANIFOLD: &str = "GPLVM_APPROX.";
/// The titles of the box plots of models, which figures are found by.
pub const BY_MODEL: &str = "By model, the better of several fits";
/// The same by type of material.
pub const BY_MODEL_AND_TYPE: &str = "By model and material type, the better of several fits";

/// A study's mean opinions, made ready for comparisons. Rows are indices of `opinions`.
pub(super) struct Comparison<'a> {
    opinions: &'a [RatedStimulus],
    mos: Vec<f64>,
    scale: RatingScale,
    /// Standard deviations come from scores, not from a model.
    measured: bool,
    /// Most stimuli first.
    illuminations: Vec<&'a str>,
    /// Rows under the first illumination, without hidden references and those alone.
    approximations: Vec<usize>,
    references: Vec<usize>,
    resamples: Option<Resamples>,
}

impl<'a> Comparison<'a> {
    pub fn new(
        opinions: &'a [RatedStimulus],
        scale: RatingScale,
        measured: bool,
        options: &Options,
        notes: &mut Notes,
    ) -> Self {
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        for o in opinions {
            if let Some(illumination) = &o.stimulus.illumination {
                *numbers.entry(illumination).or_default() += 1;
            }
        }
        let mut illuminations: Vec<&str> = numbers.keys().copied().collect();
        illuminations.sort_by_key(|i| Reverse(numbers[i]));
        let main = |o: &RatedStimulus| o.stimulus.illumination.as_deref() == illuminations.first().copied();
        let (references, approximations) =
            (0..opinions.len()).filter(|&i| main(&opinions[i])).partition(|&i| opinions[i].stimulus.is_reference());
        let groups = rows_by_name(opinions.iter().map(|o| o.stimulus.group.as_str()));
        let drawn = Resamples::draw(&groups, options.resamples, options.seed, "study-bootstrap");
        let resamples = notes.keep("intervals by material", drawn.map_err(StudyError::from));
        let mos = opinions.iter().map(|o| o.opinion.mos).collect();
        Self { opinions, mos, scale, measured, illuminations, approximations, references, resamples }
    }

    pub fn illuminations(&self) -> Vec<String> {
        self.illuminations.iter().map(|i| (*i).to_owned()).collect()
    }

    /// The spread of opinions over the scale.
    pub fn sos(&self) -> Result<SosFit, StudyError> {
        if !self.measured {
            return Err(StudyError::NoRawScores);
        }
        if self.scale.is_open() {
            return Err(StudyError::OpenScale);
        }
        let rows: Vec<usize> = (0..self.mos.len()).filter(|&r| self.opinions[r].opinion.deviation.is_some()).collect();
        let (means, variances) = means_and_variances(rows.iter().map(|&r| &self.opinions[r].opinion), self.scale);
        let mut fit = sos::fit(&means, &variances)?;
        fit.rmse = self.scale.width(fit.rmse);
        fit.interval = self.resamples.as_ref().and_then(|resamples| {
            resamples
                .interval(|counts| sos::slope(&means, &variances, &rows.iter().map(|&r| counts[r]).collect::<Vec<_>>()))
        });
        Ok(fit)
    }

    pub fn material_types(&self, notes: &mut Notes) -> Option<TypeComparison> {
        let what = "comparison of material types";
        let types = notes.keep(what, self.two_types())?;
        let of = |rows: &[usize], t: &str| -> Vec<usize> {
            rows.iter().copied().filter(|&r| self.level(r, TYPE) == Some(t)).collect()
        };
        let [a, b] = types.map(|t| of(&self.approximations, t));
        let mos = notes.keep(what, welch(&self.pick(&a), &self.pick(&b)))?;
        let by_material = self.resamples.as_ref().and_then(|resamples| {
            let means = |counts: &[u32]| [&a, &b].map(|rows| resampling::mean(&self.mos, rows, counts));
            resamples.interval(|counts| match means(counts) {
                [Some(a), Some(b)] => Some(a - b),
                _ => None,
            })
        });
        let deviation = self.deviation_test("standard deviations by material type", notes, || {
            welch(&self.deviations(&a), &self.deviations(&b))
        });
        let hidden = types.map(|t| self.pick(&of(&self.references, t)));
        let hidden_references = notes.keep("material types of hidden references", self.hidden(&hidden, welch));
        let types = types.map(str::to_owned);
        Some(TypeComparison { types, mos, by_material, deviation, hidden_references })
    }

    pub fn illumination(&self, notes: &mut Notes) -> Option<IlluminationComparison> {
        let what = "comparison of illuminations";
        let (names, both) = notes.keep(what, self.under_both())?;
        let side = |k: usize, rows: &[[usize; 2]]| rows.iter().map(|pair| pair[k]).collect::<Vec<_>>();
        let [a, b] = [0, 1].map(|k| side(k, &both));
        let (x, y) = (self.pick(&a), self.pick(&b));
        let mos = notes.keep(what, paired(&x, &y))?;
        let correlations = pearson(&x, &y).and_then(|p| Ok((p, spearman(&x, &y)?)));
        let (pearson, spearman) = notes.keep(what, correlations.map_err(StudyError::from))?;
        let deviation = self.deviation_test("standard deviations by illumination", notes, || {
            paired(&self.deviations(&a), &self.deviations(&b))
        });
        let is_hidden = |pair: &[usize; 2]| self.opinions[pair[0]].stimulus.is_reference();
        let hidden: Vec<[usize; 2]> = both.iter().copied().filter(is_hidden).collect();
        let hidden = [0, 1].map(|k| self.pick(&side(k, &hidden)));
        let hidden_references = notes.keep("illuminations of hidden references", self.hidden(&hidden, paired));
        let resampled = |statistic: &(dyn Fn(&[u32]) -> Option<f64> + Sync)| {
            let of_pairs = |counts: &[u32]| a.iter().map(|&r| counts[r]).collect::<Vec<_>>();
            self.resamples.as_ref().and_then(|r| r.interval(|counts| statistic(&of_pairs(counts))))
        };
        let (rank_x, rank_y) = (Ranking::of(&x), Ranking::of(&y));
        Some(IlluminationComparison {
            illuminations: names.map(str::to_owned),
            mos,
            deviation,
            hidden_references,
            pearson,
            spearman,
            pearson_interval: resampled(&|counts| pearson_counted(&x, &y, counts).ok()),
            spearman_interval: resampled(&|counts| spearman_counted(&rank_x, &rank_y, counts).ok()),
        })
    }

    pub fn anova_two_way(&self, notes: &mut Notes) -> Option<Anova> {
        let typed = |&r: &usize| self.level(r, TYPE).is_some();
        let rows: Vec<usize> = self.approximations.iter().copied().filter(typed).collect();
        notes.keep("ANOVA of material type and method", self.analyse(&rows, &[TYPE, METHOD]))
    }

    pub fn anova_three_way(&self, notes: &mut Notes) -> Option<Anova> {
        let what = "ANOVA of illumination, material type and method";
        let (_, both) = notes.keep(what, self.under_both())?;
        let used = |&r: &usize| self.level(r, TYPE).is_some() && !self.opinions[r].stimulus.is_reference();
        let rows: Vec<usize> = both.into_iter().flatten().filter(used).collect();
        notes.keep(what, self.analyse(&rows, &[ILLUMINATION, TYPE, METHOD]))
    }

    /// Box plots of everything, of each type, each method, and their combinations.
    pub fn boxes(&self) -> Vec<BoxSet> {
        let main: Vec<usize> = self.approximations.iter().chain(&self.references).copied().collect();
        let better = self.better_fits(&main);
        let (several, left_out) = match &better {
            Some(better) => (better.rows.as_slice(), better.left_out.clone()),
            None => (&[][..], None),
        };
        let both: Vec<usize> =
            self.under_both().map(|(_, both)| both.into_iter().flatten().collect()).unwrap_or_default();
        [
            ("Everything", main.as_slice(), &[][..]),
            ("Approximations by material type", &self.approximations, &[TYPE][..]),
            ("Hidden references by material type", &self.references, &[TYPE]),
            ("By method", &main, &[METHOD]),
            ("By method and material type", &main, &[METHOD, TYPE]),
            (BY_MODEL, several, &[MODEL]),
            (BY_MODEL_AND_TYPE, several, &[MODEL, TYPE]),
            ("By illumination and material type, of what was rated under both", &both, &[ILLUMINATION, TYPE]),
            ("By step along the manifold", &self.approximations, &[STEP]),
        ]
        .into_iter()
        .map(|(title, rows, factors)| {
            let note = if factors.contains(&MODEL) { left_out.clone() } else { None };
            BoxSet { note, ..self.box_set(title, rows, factors) }
        })
        .filter(|set| !set.boxes.is_empty())
        .collect()
    }

    fn box_set(&self, title: &str, rows: &[usize], factors: &[&str]) -> BoxSet {
        let mut cells: BTreeMap<Vec<&str>, Vec<usize>> = BTreeMap::new();
        for &row in rows {
            if let Some(levels) = factors.iter().map(|f| self.level(row, f)).collect::<Option<Vec<_>>>() {
                cells.entry(levels).or_default().push(row);
            }
        }
        let named = |(levels, rows): (Vec<&str>, Vec<usize>)| {
            let values = self.pick(&rows);
            let widths: Vec<f64> = rows.iter().filter_map(|&r| self.opinions[r].opinion.width()).collect();
            Some(NamedBox {
                levels: levels.into_iter().map(str::to_owned).collect(),
                mos: BoxPlot::of(&values)?,
                mean: mean(&values)?,
                mean_interval: self
                    .resamples
                    .as_ref()
                    .and_then(|resamples| resamples.interval(|counts| resampling::mean(&self.mos, &rows, counts))),
                interval_width: if self.measured { BoxPlot::of(&widths) } else { None },
            })
        };
        let factors = factors.iter().map(|f| (*f).to_owned()).collect();
        BoxSet { title: title.to_owned(), factors, note: None, boxes: cells.into_iter().filter_map(named).collect() }
    }

    fn level(&self, row: usize, factor: &str) -> Option<&'a str> {
        let stimulus = &self.opinions[row].stimulus;
        match factor {
            TYPE => stimulus.material_type.as_deref(),
            ILLUMINATION => stimulus.illumination.as_deref(),
            MODEL => Some(&stimulus.method_family),
            STEP => stimulus.method.strip_prefix(MANIFOLD),
            _ => Some(&stimulus.method),
        }
    }

    fn pick(&self, rows: &[usize]) -> Vec<f64> {
        rows.iter().map(|&r| self.mos[r]).collect()
    }

    /// Standard deviations of the scores; [`Self::deviation_test`] sees to it that every stimulus has one.
    fn deviations(&self, rows: &[usize]) -> Vec<f64> {
        rows.iter().filter_map(|&r| self.opinions[r].opinion.deviation).collect()
    }

    fn analyse(&self, rows: &[usize], factors: &[&str]) -> Result<Anova, StudyError> {
        let factor =
            |name: &&'static str| Factor { name, levels: rows.iter().filter_map(|&r| self.level(r, name)).collect() };
        let known = [ILLUMINATION, TYPE, METHOD];
        let factors: Vec<Factor> = known.iter().filter(|k| factors.contains(k)).map(factor).collect();
        anova(&self.pick(rows), &factors)
    }

    fn two_types(&self) -> Result<[&'a str; 2], StudyError> {
        let found: BTreeSet<&str> = self.approximations.iter().filter_map(|&r| self.level(r, TYPE)).collect();
        let found: Vec<&str> = found.into_iter().collect();
        two(&found).ok_or_else(|| levels("material types", &found))
    }

    /// The two illuminations, and the rows of what was rated under both.
    fn under_both(&self) -> Result<([&'a str; 2], Vec<[usize; 2]>), StudyError> {
        let names = two(&self.illuminations).ok_or_else(|| levels("illuminations", &self.illuminations))?;
        let mut rows: BTreeMap<(&str, &str), [Option<usize>; 2]> = BTreeMap::new();
        for (row, o) in self.opinions.iter().enumerate() {
            let at = names.iter().position(|n| o.stimulus.illumination.as_deref() == Some(n));
            if let Some(at) = at {
                rows.entry((&o.stimulus.material, &o.stimulus.method)).or_default()[at] = Some(row);
            }
        }
        let both = rows.into_values().filter_map(|[a, b]| Some([a?, b?])).collect();
        Ok((names, both))
    }

    fn deviation_test(
        &self,
        what: &str,
        notes: &mut Notes,
        test: impl Fn() -> Result<TTest, StudyError>,
    ) -> Option<TTest> {
        let every = self.opinions.iter().all(|o| o.opinion.deviation.is_some());
        let allowed = if self.measured { Ok(()) } else { Err(StudyError::NoRawScores) };
        let single = StudyError::TooFew { what: "scores of each stimulus", found: 1, least: 2 };
        notes.keep(what, allowed.and(if every { test() } else { Err(single) }))
    }

    fn hidden(
        &self,
        [a, b]: &[Vec<f64>; 2],
        test: impl Fn(&[f64], &[f64]) -> Result<TTest, StudyError>,
    ) -> Result<TTest, StudyError> {
        if a.is_empty() && b.is_empty() {
            return Err(StudyError::TooFew { what: "hidden references", found: 0, least: 2 });
        }
        test(a, b)
    }
}

fn two<'a>(found: &[&'a str]) -> Option<[&'a str; 2]> {
    <[&str; 2]>::try_from(found.to_vec()).ok()
}

fn levels(what: &'static str, found: &[&str]) -> StudyError {
    let named =
        if found.is_empty() { "0 (none stated)".to_owned() } else { format!("{} ({})", found.len(), found.join(", ")) };
    StudyError::Levels { what, found: named, allowed: "2" }
}
