//! The derivative of a number by the values of the candidate, from its derivative by the descriptors: the reverse pass.
//!
//!   values at the directions -> table -> pictures, albedos -> descriptors   (the table also goes to the descriptors directly)
//!
//! Each arrow has its transpose beside it, and the slopes go back through them. The reference is constant. Cost: about that of the
//! candidate's features and one comparison.

use super::comparison::{self, albedo_slopes, width};
use super::features::{BrdfFeatures, Derived};
use super::set::{DescriptorSet, Family};
use super::{DescriptorError, Setup};
use crate::light::Sites;
use crate::math::Rgb;

impl DescriptorSet {
    /// Whether [`DescriptorSet::gradient`] gives one: descriptors from version 2 on, without distances of value distributions.
    pub fn is_differentiable(&self, setup: &Setup) -> bool {
        self.without_derivative(setup).is_none()
    }

    fn without_derivative(&self, setup: &Setup) -> Option<String> {
        if setup.version() == 1 {
            return Some("descriptors of version 1".into());
        }
        let family = self.families().iter().find(|f| **f == Family::Wasserstein);
        family.map(|f| format!("descriptors of the family `{}`", f.name()))
    }

    /// The derivative of a number by the candidate's `values` (linear RGB, 1/sr) at the directions of [`Sites::of`] the setup's
    /// sampling, one triple a direction, from its derivative by the descriptors, one a column in the order of
    /// [`DescriptorSet::columns`]. `candidate` must be [`BrdfFeatures::of_values`] of these values.
    ///
    /// Columns of the context depend on the reference alone; what is given for them has no effect. A negative value counts as 0 and has
    /// a derivative of 0, as has a norm where it is 0.
    ///
    /// # Errors
    /// [`DescriptorError::NoDerivative`] where [`DescriptorSet::is_differentiable`] is false; [`DescriptorError::Length`] for another
    /// number of values or slopes.
    ///
    /// # Panics
    /// If reference or candidate was not computed under `setup`.
    pub fn gradient(
        &self,
        reference: &BrdfFeatures,
        candidate: &BrdfFeatures,
        setup: &Setup,
        values: &[Rgb],
        by_descriptor: &[f64],
    ) -> Result<Vec<Rgb>, DescriptorError> {
        let length = |what: &'static str, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(DescriptorError::Length { what, found, expected }) }
        };
        let without = self.without_derivative(setup).map(|what| DescriptorError::NoDerivative { what });
        without.map_or(Ok(()), Err)?;
        let sites = Sites::of(setup.sampling());
        length("values of the BRDF", values.len(), sites.len())?;
        length("slopes by descriptors", by_descriptor.len(), self.len())?;
        let (Derived::V2(a), Derived::V2(b)) = (&reference.derived, &candidate.derived) else {
            panic!("reference and candidate are features of another version");
        };
        let (a, b) = ((&reference.stored, a), (&candidate.stored, b));
        let slopes = comparison::transpose(self.families(), a, b, setup.frame(), by_descriptor);
        let operators = setup.operators();
        let mut by_table = slopes.table;
        let mut add = |by: Vec<Rgb>| {
            by_table.iter_mut().zip(by).for_each(|(to, by)| (0..3).for_each(|c| to[c] += by[c]));
        };
        if slopes.pictures.iter().flatten().flatten().any(|slope| *slope != 0.0) {
            add(operators.pictures.transpose(&slopes.pictures));
        }
        if slopes.albedo != [0.0; 2] {
            add(operators.albedo.transpose(&[albedo_slopes(slopes.albedo)]));
        }
        let mut rest = &by_descriptor[by_descriptor.len() - self.embedded()..];
        for embedding in self.embeddings() {
            let (own, others) = rest.split_at(embedding.dimension());
            add(embedding.transpose(candidate.table(), own));
            rest = others;
        }
        Ok(sites.transpose(values, &by_table))
    }

    /// Number of columns of the embeddings.
    fn embedded(&self) -> usize {
        self.embeddings().iter().map(|e| e.dimension()).sum()
    }

    /// Number of columns.
    fn len(&self) -> usize {
        self.families().iter().map(|f| width(*f)).sum::<usize>() + self.embedded()
    }
}

#[cfg(test)]
mod tests {
    use super::super::features::Stored;
    use super::super::frame::Frame;
    use super::comparison::{Derived, Slopes, compare, transpose};
    use super::*;
    use crate::brdf::Brdf;
    use crate::brdf::models::{Ggx, Lambert};
    use crate::light::node_table::NODES;
    use crate::light::{NodeTable, Sampling, Shape};
    use crate::math::Vec3;
    use crate::math::seed::stream;
    use rand::Rng;

    /// All that have a derivative.
    const FAMILIES: [Family; 9] = [
        Family::Lights,
        Family::Slot,
        Family::SlotDetail,
        Family::Angular,
        Family::AngularFull,
        Family::Context,
        Family::Change,
        Family::Display,
        Family::Norms,
    ];

    fn frame() -> (Shape, Frame) {
        let shape = Shape::sphere();
        let frame = Frame::new(&shape);
        (shape, frame)
    }

    /// A BRDF and pictures that look somewhat like it: a diffuse shade and a highlight for each of four lights.
    fn stored(shape: &Shape, brdf: &dyn Brdf, colour: Rgb, peak: f64, sharpness: f64) -> Stored {
        let pixel = |p: usize, l: usize| -> Rgb {
            let n = shape.normals(p)[0];
            let light = Vec3::from_spherical(0.3 + 0.3 * l as f64, 1.7 * l as f64);
            let highlight = peak * (sharpness * (n.dot(light) - 1.0)).exp();
            colour.map(|c| c * (0.2 + n.dot(light).max(0.0)) + highlight)
        };
        Stored {
            table: NodeTable::sample(brdf, Sampling::Averages).unwrap(),
            pictures: (0..4).map(|l| (0..shape.len()).map(|p| pixel(p, l)).collect()).collect(),
            albedo: [0.3 * colour[0], 0.4 * colour[0] + 0.01],
        }
    }

    fn ggx(alpha: f64) -> Ggx {
        Ggx::new([0.2, 0.1, 0.05], [0.05, 0.06, 0.08], alpha).unwrap()
    }

    /// Measured nowhere near the horizon.
    struct Holed(Ggx);

    impl Brdf for Holed {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            if wi.z.min(wo.z) < 0.2 { None } else { self.0.eval(wi, wo) }
        }
    }

    /// Every value of `stored` times 1 + step * direction.
    fn moved(stored: &Stored, direction: &Slopes, step: f64) -> Stored {
        let along = |values: &[Rgb], by: &[Rgb]| -> Vec<Rgb> {
            values.iter().zip(by).map(|(v, d)| std::array::from_fn(|c| v[c] * (1.0 + step * d[c]))).collect()
        };
        let table = along(stored.table.values(), &direction.table);
        Stored {
            table: NodeTable::from_parts(table, stored.table.sampled().to_vec()).unwrap(),
            pictures: stored.pictures.iter().zip(&direction.pictures).map(|(p, d)| along(p, d)).collect(),
            albedo: std::array::from_fn(|k| stored.albedo[k] * (1.0 + step * direction.albedo[k])),
        }
    }

    /// The terms whose sum is the derivative along a direction.
    fn terms(stored: &Stored, direction: &Slopes, slopes: &Slopes) -> Vec<f64> {
        let of = |values: &[Rgb], d: &[Rgb], by: &[Rgb]| -> Vec<f64> {
            let flat = values.iter().flatten().zip(d.iter().flatten()).zip(by.iter().flatten());
            flat.map(|((v, d), by)| v * d * by).collect()
        };
        let mut out = of(stored.table.values(), &direction.table, &slopes.table);
        for ((p, d), by) in stored.pictures.iter().zip(&direction.pictures).zip(&slopes.pictures) {
            out.extend(of(p, d, by));
        }
        out.extend((0..2).map(|k| stored.albedo[k] * direction.albedo[k] * slopes.albedo[k]));
        out
    }

    #[test]
    fn every_descriptor_has_the_slope_of_its_central_differences() {
        let (shape, frame) = frame();
        let mut random = stream(1, "slopes of descriptors", 0);
        let grey = Lambert { kd: [0.3; 3] };
        let cases = [
            (stored(&shape, &ggx(0.1), [0.6, 0.3, 0.15], 6.0, 40.0), stored(&shape, &grey, [0.3; 3], 0.0, 1.0)),
            (stored(&shape, &grey, [0.3; 3], 0.0, 1.0), stored(&shape, &ggx(0.02), [0.5, 0.3, 0.2], 60.0, 200.0)),
            (
                stored(&shape, &Holed(ggx(0.3)), [0.5, 0.3, 0.2], 1.0, 10.0),
                stored(&shape, &ggx(0.4), [0.6; 3], 0.8, 8.0),
            ),
        ];
        let columns = DescriptorSet::new(FAMILIES.to_vec()).columns();
        for (reference, candidate) in &cases {
            let a = Derived::new(reference, &frame);
            let value = |stored: &Stored| {
                let b = Derived::new(stored, &frame);
                compare(&FAMILIES, (reference, &a), (stored, &b), &frame).concat()
            };
            let b = Derived::new(candidate, &frame);
            let mut uniform = || -> Rgb { std::array::from_fn(|_| random.random_range(-1.0..1.0)) };
            let direction = Slopes {
                table: (0..NODES).map(|_| uniform()).collect(),
                pictures: (0..4).map(|_| (0..shape.len()).map(|_| uniform()).collect()).collect(),
                albedo: [0.7, -0.4],
            };
            // Richardson's extrapolation of two central differences.
            let central = |h: f64| -> Vec<f64> {
                let (above, below) =
                    (value(&moved(candidate, &direction, h)), value(&moved(candidate, &direction, -h)));
                above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect()
            };
            let (wide, narrow) = (central(2e-4), central(1e-4));
            for (k, column) in columns.iter().enumerate() {
                let mut by = vec![0.0; columns.len()];
                by[k] = 1.0;
                let slopes = transpose(&FAMILIES, (reference, &a), (candidate, &b), &frame, &by);
                let terms = terms(candidate, &direction, &slopes);
                let found: f64 = terms.iter().sum();
                let scale = terms.iter().map(|t| t * t).sum::<f64>().sqrt();
                let expected = if column.family == "context" { 0.0 } else { (4.0 * narrow[k] - wide[k]) / 3.0 };
                let error = (found - expected).abs();
                assert!(error <= 1e-5 * scale.max(found.abs()) + 1e-9, "{}: {found} {expected}", column.name);
            }
        }
    }

    #[test]
    fn slopes_at_equal_brdfs_blacks_and_mirrors_are_finite() {
        let (shape, frame) = frame();
        let black = stored(&shape, &Lambert { kd: [0.0; 3] }, [0.0; 3], 0.0, 1.0);
        let mirror = stored(&shape, &ggx(0.001), [0.0; 3], 1e4, 2000.0);
        let plain = stored(&shape, &Lambert { kd: [0.3; 3] }, [0.3; 3], 0.0, 1.0);
        let all = [&black, &mirror, &plain];
        for reference in all {
            for candidate in all {
                let (a, b) = (Derived::new(reference, &frame), Derived::new(candidate, &frame));
                let values = compare(&FAMILIES, (reference, &a), (candidate, &b), &frame);
                for (family, values) in FAMILIES.iter().zip(&values) {
                    assert!(values.iter().all(|v| v.is_finite()), "{family:?}");
                    let equal = std::ptr::eq(reference, candidate) && *family != Family::Context;
                    assert!(!equal || values.iter().all(|v| *v == 0.0), "{family:?}: {values:?}");
                }
                let by = vec![1.0; values.concat().len()];
                let slopes = transpose(&FAMILIES, (reference, &a), (candidate, &b), &frame, &by);
                let numbers =
                    slopes.table.iter().chain(slopes.pictures.iter().flatten()).flatten().chain(&slopes.albedo);
                assert!(numbers.into_iter().all(|v| v.is_finite()));
            }
        }
    }
}
