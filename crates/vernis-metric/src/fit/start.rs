//! Where a fit begins: the colours by linear least squares, for each of a few widths of the lobe.
//!
//! Most models are linear in their colours (albedos, lobe heights, Schlick's f0), channel by channel:
//! f = f_0 + sum_k x_k f_k, with f_0 and f_k given by the other parameters, the shape. For a shape the colours are solved in
//! two stages: the first colour (the diffuse albedo, where there is one) from cells away from the highlight,
//! theta_h >= 45 degrees, each weighted by 1/(f cos_i cos_o + 0.001)^2, and then the others from all cells, weighted by
//! cos_o sin_o. A second candidate solves all colours at once with the first weights. Each field of the shape in turn is swept
//! over its range, and the candidates with the lowest loss are the starts. Which colours are linear is found out by trying:
//! a field of three channels in which, together with those before, the model is affine to rounding.
//!
//! The least squares under bounds are those of [`within_bounds`]. Cost: about a hundred evaluations of the loss.

use super::loss::{Lattice, Loss};
use super::{FitError, Space};
use crate::brdf::models::NamedParameters;
use crate::math::coordinates::standard_directions;
use crate::math::least_squares::within_bounds;
use crate::math::{Rgb, Vec3};
use std::ops::ControlFlow;

/// Values tried along each field of the shape.
const SWEEP: usize = 12;
/// Numbers that are swept at most; models with more are tables.
const SWEPT_NUMBERS: usize = 9;
/// Fields that are swept at most, whatever they hold.
const SWEPT_FIELDS: usize = 8;
/// Below this angle between half vector and normal, degrees, a lobe may hide the diffuse part.
const OFF_PEAK: f64 = 45.0;
/// Keeps relative weights finite, as in the logarithmic metrics.
const EPSILON: f64 = 1e-3;

/// A start and its loss.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The parameter vector.
    pub parameters: Vec<f64>,
    /// The loss at these parameters.
    pub value: f64,
}

/// A field of a model: `count` numbers from `first` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Field {
    first: usize,
    count: usize,
}

fn fields(space: &Space) -> Result<Vec<Field>, FitError> {
    let named = NamedParameters::new(space.model()).map_err(FitError::from_model)?;
    let mut first = 0;
    let field = |(_, count): (&str, usize)| {
        first += count;
        Field { first: first - count, count }
    };
    Ok(named.fields().into_iter().map(field).collect())
}

/// The best starts under `loss`, best first, at most `count`: of all shapes that were tried, and the start of the schema. Where
/// the observer says so, of those tried by then.
///
/// # Errors
/// Those of the loss; [`FitError::Start`] where it is finite nowhere.
pub fn staged(
    space: &Space,
    reference: &Lattice,
    loss: &dyn Loss,
    count: usize,
    observer: &(dyn Fn() -> ControlFlow<()> + Sync),
) -> Result<Vec<Candidate>, FitError> {
    Ok(ranked(space, reference, loss, observer)?.best(count))
}

/// All starts that were tried and have a loss, best first.
pub(super) struct Ranked {
    all: Vec<Candidate>,
    /// The parameters that are no colours.
    shape: Vec<usize>,
}

impl Ranked {
    /// The best of them, at most `count`, at least one.
    pub fn best(mut self, count: usize) -> Vec<Candidate> {
        self.all.truncate(count.max(1));
        self.all
    }

    /// The best start of each shape but the first one's, at most `count`. Shapes that are nearer to each other than `same`, in every
    /// coordinate of `space`, are one.
    pub fn other_shapes(&self, space: &Space, count: usize, same: f64) -> Vec<Candidate> {
        let shape = |c: &Candidate| -> Vec<f64> {
            let scaled = space.scaled(&c.parameters);
            self.shape.iter().map(|&k| scaled[k]).collect()
        };
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < same);
        let mut shapes: Vec<Vec<f64>> = self.all.iter().take(1).map(shape).collect();
        let mut others = Vec::new();
        for candidate in &self.all {
            let found = shape(candidate);
            if others.len() < count && !shapes.iter().any(|known| near(known, &found)) {
                shapes.push(found);
                others.push(candidate.clone());
            }
        }
        others
    }
}

/// [`staged`], all of them.
///
/// # Errors
/// Those of [`staged`].
pub(super) fn ranked(
    space: &Space,
    reference: &Lattice,
    loss: &dyn Loss,
    observer: &(dyn Fn() -> ControlFlow<()> + Sync),
) -> Result<Ranked, FitError> {
    let colours = LinearColours::of(space, reference)?;
    let mut tried = Tried { space, loss, observer, ended: false, all: Vec::new() };
    let start = space.start();
    tried.add(start.clone())?;
    let mut best = colours.best(&mut tried, &start)?;
    let shape: Vec<Field> = fields(space)?.into_iter().filter(|f| !colours.fields.contains(f)).collect();
    let numbers: usize = shape.iter().map(|field| field.count).sum();
    if shape.len() <= SWEPT_FIELDS || numbers <= SWEPT_NUMBERS {
        for field in &shape {
            let centre = best.parameters.clone();
            for value in sweep(space, *field) {
                if tried.ended && best.value.is_finite() {
                    break;
                }
                let mut p = centre.clone();
                p[field.first..field.first + field.count].fill(value);
                let found = colours.best(&mut tried, &p)?;
                if found.value < best.value {
                    best = found;
                }
            }
        }
    }
    let mut all = tried.all;
    all.retain(|c| c.value.is_finite());
    all.sort_by(|a, b| a.value.total_cmp(&b.value));
    all.dedup_by(|a, b| a.parameters == b.parameters);
    if all.is_empty() {
        let reason = "the loss is finite at no start that was tried".to_owned();
        let refusal = space.build(&start).ok().and_then(|model| loss.refusal(&*model));
        return Err(FitError::Start { reason: refusal.map_or(reason.clone(), |e| format!("{reason} ({e})")) });
    }
    let is_colour = |k: &usize| colours.fields.iter().any(|f| (f.first..f.first + f.count).contains(k));
    Ok(Ranked { all, shape: (0..start.len()).filter(|k| !is_colour(k)).collect() })
}

/// Values of a field, evenly spaced in the coordinates of the search.
fn sweep(space: &Space, field: Field) -> Vec<f64> {
    let (low, high) = space.bounds()[field.first];
    let at = |k: usize| {
        let mut u = space.scaled(&space.start());
        u[field.first] = low + (k as f64 + 0.5) / SWEEP as f64 * (high - low);
        space.parameters(&u)[field.first]
    };
    (0..SWEEP).map(at).collect()
}

/// Every start that was evaluated.
struct Tried<'a> {
    space: &'a Space,
    loss: &'a dyn Loss,
    observer: &'a (dyn Fn() -> ControlFlow<()> + Sync),
    /// The observer has said so.
    ended: bool,
    all: Vec<Candidate>,
}

impl Tried<'_> {
    fn add(&mut self, parameters: Vec<f64>) -> Result<Candidate, FitError> {
        let value = match self.space.build(&parameters) {
            Err(FitError::Model(_)) => f64::INFINITY,
            model => self.loss.value(&*model?)?,
        };
        self.ended |= (self.observer)().is_break();
        let candidate = Candidate { parameters, value };
        self.all.push(candidate.clone());
        Ok(candidate)
    }
}

/// One direction pair with what least squares need of it.
struct Cell {
    wi: Vec3,
    wo: Vec3,
    reference: Rgb,
    /// For the lobes, and for relative differences by channel; the number of cells behind it included.
    absolute: f64,
    relative: Rgb,
    off_peak: bool,
}

/// The colours that a model is linear in.
struct LinearColours<'a> {
    space: &'a Space,
    fields: Vec<Field>,
    cells: Vec<Cell>,
}

impl<'a> LinearColours<'a> {
    fn of(space: &'a Space, reference: &Lattice) -> Result<Self, FitError> {
        let mut linear = Vec::new();
        for field in fields(space)?.into_iter().filter(|f| f.count == 3) {
            linear.push(field);
            if !is_affine(space, &linear)? {
                linear.pop();
            }
        }
        let cells = reference.iter().filter_map(|(sample, wi, wo)| {
            let mean = sample.mean()?;
            let count = sample.cells();
            let h = (wi + wo).normalized();
            Some(Cell {
                wi,
                wo,
                reference: mean,
                absolute: count * wo.z * (1.0 - wo.z * wo.z).max(0.0).sqrt(),
                relative: mean.map(|f| count * (f * wi.z * wo.z + EPSILON).powi(-2)),
                off_peak: h.z < OFF_PEAK.to_radians().cos(),
            })
        });
        Ok(Self { space, fields: linear, cells: cells.collect() })
    }

    /// The better of the two solutions for the shape of `p`.
    fn best(&self, tried: &mut Tried<'_>, p: &[f64]) -> Result<Candidate, FitError> {
        if self.fields.is_empty() {
            return tried.add(p.to_vec());
        }
        let columns = match self.columns(p) {
            // A shape that the model refuses is no start.
            Err(FitError::Model(_)) => return tried.add(p.to_vec()),
            columns => columns?,
        };
        let all: Vec<usize> = (0..self.fields.len()).collect();
        let together = self.solve(p, &columns, &all, |cell, c| cell.relative[c])?;
        let off_peak = |cell: &Cell, c: usize| if cell.off_peak { cell.relative[c] } else { 0.0 };
        let diffuse = self.solve(p, &columns, &all[..1], off_peak)?;
        let staged = self.solve(&diffuse, &columns, &all[1..], |cell, _| cell.absolute)?;
        let (a, b) = (tried.add(together)?, tried.add(staged)?);
        Ok(if a.value < b.value { a } else { b })
    }

    /// f_0 and f_k at every cell.
    fn columns(&self, p: &[f64]) -> Result<Vec<Vec<Rgb>>, FitError> {
        let mut black = p.to_vec();
        for field in &self.fields {
            let lowest = |k: usize| self.space.schema()[k].bounds.0.max(0.0);
            (field.first..field.first + 3).for_each(|k| black[k] = lowest(k));
        }
        let at = |p: &[f64]| -> Result<Vec<Rgb>, FitError> {
            let model = self.space.build(p)?;
            Ok(self.cells.iter().map(|cell| model.value(cell.wi, cell.wo)).collect())
        };
        let base = at(&black)?;
        let mut columns = vec![base.clone()];
        for field in &self.fields {
            let mut lit = black.clone();
            (field.first..field.first + 3).for_each(|k| lit[k] += unit(self.space, *field));
            let unit = unit(self.space, *field);
            let column = at(&lit)?;
            columns.push(column.iter().zip(&base).map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]) / unit)).collect());
        }
        Ok(columns)
    }

    /// `p` with the colours number `chosen` solved for, within their bounds; the others stay.
    fn solve(
        &self,
        p: &[f64],
        columns: &[Vec<Rgb>],
        chosen: &[usize],
        weight: impl Fn(&Cell, usize) -> f64,
    ) -> Result<Vec<f64>, FitError> {
        let n = chosen.len();
        let mut solved = p.to_vec();
        for c in 0..3 {
            let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
            for (k, cell) in self.cells.iter().enumerate() {
                let w = weight(cell, c);
                if w == 0.0 {
                    continue;
                }
                let fixed = |(j, field): (usize, &Field)| {
                    if chosen.contains(&j) { 0.0 } else { p[field.first + c] * columns[j + 1][k][c] }
                };
                let rest =
                    cell.reference[c] - columns[0][k][c] - self.fields.iter().enumerate().map(fixed).sum::<f64>();
                for (a, &i) in chosen.iter().enumerate() {
                    let x = columns[i + 1][k][c];
                    right[a] += w * x * rest;
                    chosen.iter().enumerate().for_each(|(b, &j)| matrix[a * n + b] += w * x * columns[j + 1][k][c]);
                }
            }
            let place = |i: usize| self.fields[i].first + c;
            let bounds: Vec<(f64, f64)> = chosen.iter().map(|&i| self.space.schema()[place(i)].bounds).collect();
            let x = within_bounds(&matrix, &right, &bounds);
            chosen.iter().zip(x).for_each(|(&i, x)| solved[place(i)] = x);
        }
        Ok(solved)
    }
}

/// A value of a colour at which its share is measured.
fn unit(space: &Space, field: Field) -> f64 {
    let parameter = &space.schema()[field.first];
    if parameter.start > 0.0 { parameter.start } else { 0.1 * parameter.bounds.1.min(1.0) }
}

/// Whether the model is affine in the colours `fields` together, at a few directions: the value at the mean of two points
/// is the mean of the values, for points that differ in all of them.
fn is_affine(space: &Space, fields: &[Field]) -> Result<bool, FitError> {
    let at = |amounts: &dyn Fn(usize) -> f64| {
        let mut p = space.start();
        for (j, field) in fields.iter().enumerate() {
            (field.first..field.first + 3).for_each(|k| p[k] = amounts(j) * unit(space, *field));
        }
        space.build(&p)
    };
    let high = |j: usize| if j.is_multiple_of(2) { 1.0 } else { 0.2 };
    let low = |j: usize| if j + 1 == fields.len() { 0.7 } else { 0.3 };
    let (a, b, mean) = (at(&high)?, at(&low)?, at(&|j| 0.5 * (high(j) + low(j)))?);
    let places = [(0.1, 0.1, 3.0), (0.5, 0.6, 3.1), (1.0, 0.9, 2.9), (0.3, 1.2, 0.5), (0.9, 0.2, 1.7)];
    Ok(places.into_iter().all(|(ti, to, phi)| {
        let (wi, wo) = standard_directions(ti, to, phi);
        let (a, b, mean) = (a.value(wi, wo), b.value(wi, wo), mean.value(wi, wo));
        (0..3).all(|c| (mean[c] - 0.5 * (a[c] + b[c])).abs() <= 1e-9 * (a[c].abs() + b[c].abs()))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{BlinnPhong, Ggx};
    use crate::fit::loss::LpLoss;

    #[test]
    fn colours_are_told_from_shapes() {
        let brdf = Ggx::new([0.2; 3], [0.04; 3], 0.2).unwrap();
        let lattice = Lattice::new(&brdf, 9, 80).unwrap();
        for (model, expected) in [
            ("lambert", 1),
            ("ggx", 2),
            ("ggx-conductor", 1),
            ("ward-duer", 2),
            ("abc", 2),
            ("lafortune", 2),
            ("ggx+blinn-phong", 3),
        ] {
            let space = Space::of(model).unwrap();
            assert_eq!(LinearColours::of(&space, &lattice).unwrap().fields.len(), expected, "{model}");
        }
    }

    #[test]
    fn the_start_is_near_what_made_the_reference() {
        let brdf = BlinnPhong::new([0.1, 0.3, 0.02], [0.2, 0.1, 0.05], 700.0).unwrap();
        let space = Space::of("blinn-phong").unwrap();
        let lattice = Lattice::new(&brdf, 3, 80).unwrap();
        for name in ["D4.Cl", "D9.Cl"] {
            let loss = LpLoss::new(&brdf, name.parse().unwrap(), 3).unwrap().unwrap();
            let found = staged(&space, &lattice, &loss, 3, &|| ControlFlow::Continue(())).unwrap();
            assert!(found.windows(2).all(|w| w[0].value <= w[1].value) && found.len() == 3);
            let p = &found[0].parameters;
            assert!((p[6] / 700.0).ln().abs() < 0.8, "{name}: {p:?}");
            for (k, expected) in [(0, 0.1), (1, 0.3), (2, 0.02)] {
                assert!((p[k] / expected - 1.0).abs() < 0.1, "{name}: {p:?}");
            }
        }
    }

    #[test]
    fn other_shapes_are_the_next_best_of_different_widths() {
        let brdf = Ggx::new([0.2; 3], [0.04; 3], 0.2).unwrap();
        let space = Space::of("ggx").unwrap();
        let lattice = Lattice::new(&brdf, 3, 80).unwrap();
        let loss = LpLoss::new(&brdf, "D9.Cl".parse().unwrap(), 3).unwrap().unwrap();
        let found = ranked(&space, &lattice, &loss, &|| ControlFlow::Continue(())).unwrap();
        assert_eq!(found.shape, [6], "the roughness");
        let others = found.other_shapes(&space, 3, 1e-2);
        let best = found.best(1);
        let all: Vec<&Candidate> = best.iter().chain(&others).collect();
        assert_eq!(all.len(), 4);
        assert!(all.windows(2).all(|w| w[0].value <= w[1].value), "{all:?}");
        for (k, a) in all.iter().enumerate() {
            assert!(all[..k].iter().all(|b| (a.parameters[6] / b.parameters[6]).ln().abs() > 1e-2), "{all:?}");
        }
    }
}
