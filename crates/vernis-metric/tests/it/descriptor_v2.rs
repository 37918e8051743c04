//! Descriptors of version 2: mirrors that keep their energy, and the gradient.

use crate::descriptor::ggx;
use vernis_metric::brdf::Brdf;
use vernis_metric::descriptor::{BrdfFeatures, DescriptorError, DescriptorSet, Family, Role, Setup};
use vernis_metric::light::Sites;
use vernis_metric::math::{Rgb, Vec3};

/// A GGX mirror (Walter et al. 2007) with f0 = 0.95, of any roughness alpha: the models here begin at 0.001.
struct Mirror(f64);

impl Brdf for Mirror {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let h = (wi + wo).normalized();
        let a2 = self.0 * self.0;
        let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
        let d = a2 / (std::f64::consts::PI * h.z.powi(4) * (a2 + tan2).powi(2));
        let g1 = |cos: f64| 2.0 / (1.0 + (1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt());
        let fresnel = 0.95 + 0.05 * (1.0 - wi.dot(h)).powi(5);
        Some([d * fresnel * g1(wi.z) * g1(wo.z) / (4.0 * wi.z * wo.z); 3])
    }
}

/// However narrow its lobe, a mirror sends on the same light: a lamp's image falls on some pixel.
#[test]
fn mirrors_keep_their_energy() {
    let setup = Setup::standard();
    let mean = |picture: &[Rgb]| picture.iter().map(|c| c[1]).sum::<f64>() / picture.len() as f64;
    let radiances: Vec<[f64; 2]> = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05]
        .iter()
        .map(|&alpha| {
            let features = BrdfFeatures::compute(&Mirror(alpha), &setup).unwrap();
            let slot = setup.lights() - 1;
            [(0..slot).map(|l| mean(features.picture(l))).sum::<f64>() / slot as f64, mean(features.picture(slot))]
        })
        .collect();
    println!("{radiances:.3?}");
    for light in 0..2 {
        let middle = radiances.iter().map(|r| r[light]).sum::<f64>() / radiances.len() as f64;
        assert!(radiances.iter().all(|r| (r[light] / middle - 1.0).abs() < 0.05), "{radiances:.3?}");
    }
}

/// From the values at the directions to the descriptors and back: the slope along random directions is that of central differences.
#[test]
fn the_gradient_is_that_of_central_differences() {
    let setup = Setup::standard();
    let families = Family::ALL.into_iter().filter(|f| *f != Family::Wasserstein).collect();
    let set = DescriptorSet::new(families);
    assert!(set.is_differentiable(&setup) && !DescriptorSet::all().is_differentiable(&setup));
    let sites = Sites::of(setup.sampling());
    let values_of = |brdf: &dyn Brdf| -> Vec<Rgb> {
        sites.wi().iter().zip(sites.wo()).map(|(wi, wo)| brdf.eval(*wi, *wo).unwrap()).collect()
    };
    let reference = BrdfFeatures::compute(&ggx(0.05), &setup).unwrap();
    let values = values_of(&ggx(0.15));
    let candidate = BrdfFeatures::of_values(&values, &setup).unwrap();
    assert_eq!(set.compare(&reference, &candidate, &setup), {
        let sampled = BrdfFeatures::compute(&ggx(0.15), &setup).unwrap();
        set.compare(&reference, &sampled, &setup)
    });
    let wave = |k: usize, seed: f64| ((k as f64 + 1.0) * seed * 12.9898).sin();
    for seed in [1.0, 2.3, 3.7] {
        let by: Vec<f64> = (0..set.columns().len()).map(|k| wave(k, seed)).collect();
        let direction = |s: usize, c: usize| wave(3 * s + c, seed + 0.1);
        let moved = |step: f64| -> f64 {
            let values: Vec<Rgb> = (0..values.len())
                .map(|s| std::array::from_fn(|c| values[s][c] * (1.0 + step * direction(s, c))))
                .collect();
            let moved = BrdfFeatures::of_values(&values, &setup).unwrap();
            let columns = set.columns();
            let all = set.compare(&reference, &moved, &setup);
            all.iter().zip(&by).zip(columns).filter(|(_, c)| c.role == Role::Difference).map(|((v, b), _)| v * b).sum()
        };
        let gradient = set.gradient(&reference, &candidate, &setup, &values, &by).unwrap();
        let place = |k: usize| (k / 3, k % 3);
        let term = |(s, c): (usize, usize)| gradient[s][c] * values[s][c] * direction(s, c);
        let terms: Vec<f64> = (0..3 * values.len()).map(place).map(term).collect();
        let found: f64 = terms.iter().sum();
        let scale = terms.iter().map(|t| t * t).sum::<f64>().sqrt();
        // Steps so small that hardly any difference crosses the kink of a plain norm.
        let central = |h: f64| (moved(h) - moved(-h)) / (2.0 * h);
        let expected = (4.0 * central(1e-5) - central(2e-5)) / 3.0;
        println!("{found} {expected} {scale}");
        assert!((found - expected).abs() < 1e-5 * scale.max(expected.abs()), "{found} {expected}");
    }
    assert!(matches!(
        set.gradient(&reference, &candidate, &setup, &values[1..], &vec![0.0; set.columns().len()]),
        Err(DescriptorError::Length { .. })
    ));
    assert!(matches!(set.gradient(&reference, &candidate, &setup, &values, &[]), Err(DescriptorError::Length { .. })));
    assert!(matches!(BrdfFeatures::of_values(&values[1..], &setup), Err(DescriptorError::Length { .. })));
    assert!(matches!(
        DescriptorSet::all().gradient(&reference, &candidate, &setup, &values, &[]),
        Err(DescriptorError::NoDerivative { .. })
    ));
}
