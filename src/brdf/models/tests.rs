//! Laws that hold for every model: reciprocity, energy, the checked rebuild; values worked out by hand.

use super::*;
use crate::math::coordinates::standard_directions;
use std::f64::consts::{FRAC_1_PI, PI};

fn grey(x: f64) -> Rgb {
    [x; 3]
}

fn all() -> Vec<Arc<dyn AnalyticBrdf>> {
    let kd = [0.3, 0.2, 0.1];
    let sgd = [
        kd,
        [0.04, 0.66, 0.27],
        [6.05524, 0.235756, 0.580647],
        [5.05524, 0.182842, 0.476088],
        [0.0148, 0.03, 0.049],
        [0.459, 0.45, 0.529],
        [46.4, 24.6, 14.8],
        [2.6, 2.97, 2.78],
        grey(1e-7),
        [47.8, 36.3, 31.6],
        [0.2, 0.066, -0.066],
    ];
    vec![
        Arc::new(Lambert { kd }),
        Arc::new(Ward { kd, ks: grey(0.1), alpha: 0.15, form: WardForm::Ward }),
        Arc::new(Ward { kd, ks: grey(0.1), alpha: 0.15, form: WardForm::Duer }),
        Arc::new(BlinnPhong { kd, ks: grey(0.05), n: 300.0 }),
        Arc::new(Lafortune { kd, ks: grey(0.05), cxy: -0.577, cz: 0.56, n: 4060.0 }),
        Arc::new(Abc { kd, a: [51.7, 37.9, 27.4], b: 10482.0, c: 0.817, eta: 2.2 }),
        Arc::new(Sgd::from_rows(sgd).expect("valid parameters")),
        Arc::new(Ggx { kd, f0: [0.9, 0.5, 0.04], alpha: 0.2 }),
    ]
}

#[test]
fn every_model_is_listed_reciprocal_and_finite() {
    assert_eq!(all().iter().map(|m| m.model()).collect::<Vec<_>>(), MODELS);
    for model in all() {
        for (ti, to, phi) in [(0.1, 0.1, PI), (0.3, 1.2, 2.9), (1.5, 1.55, 3.1), (0.0, 0.7, 0.0), (1.1, 0.4, 1.0)] {
            let (wi, wo) = standard_directions(ti, to, phi);
            let (a, b) = (model.value(wi, wo), model.value(wo, wi));
            for c in 0..3 {
                assert!(a[c].is_finite() && a[c] >= 0.0, "{}: {a:?}", model.model());
                assert!((a[c] - b[c]).abs() <= 1e-12 * a[c].abs(), "{}: {a:?} {b:?}", model.model());
            }
        }
        let below = Vec3::new(0.6, 0.0, -0.8);
        assert_eq!(model.eval(below, Vec3::new(0.0, 0.0, 1.0)), Some([0.0; 3]), "{}", model.model());
    }
}

#[test]
fn rebuilding_from_the_parameter_vector_changes_nothing() {
    let (wi, wo) = standard_directions(0.4, 0.5, 3.0);
    for model in all() {
        let p = model.parameters();
        assert_eq!(p.len(), model.schema().len());
        let again = build(model.model(), &p).expect("own parameters are valid");
        assert_eq!(again.value(wi, wo), model.value(wi, wo), "{}", model.model());
        for k in 0..p.len() {
            let high = model.schema()[k].bounds.1;
            for wrong in [f64::NAN, high + 0.01 * high.abs()] {
                let mut p = p.clone();
                p[k] = wrong;
                let message = build(model.model(), &p).err().expect("out of bounds").to_string();
                assert!(message.contains(model.schema()[k].name) && message.contains("allowed"), "{message}");
            }
        }
        assert!(matches!(build(model.model(), &p[1..]), Err(ModelError::Count { .. })));
    }
    let message = build("phong", &[]).err().expect("unknown").to_string();
    assert!(message.contains("`phong`") && message.contains("blinn-phong"), "{message}");
}

/// Values at normal incidence and retroreflection, where every formula collapses to its constants.
#[test]
fn values_along_the_normal() {
    let n = Vec3::new(0.0, 0.0, 1.0);
    let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-13 * b.abs(), "{a} {b}");
    near(Ward { kd: grey(0.0), ks: grey(1.0), alpha: 0.5, form: WardForm::Ward }.value(n, n)[0], FRAC_1_PI);
    near(BlinnPhong { kd: grey(0.0), ks: grey(1.0), n: 2.0 }.value(n, n)[1], 2.0 * FRAC_1_PI);
    near(Lafortune { kd: grey(0.0), ks: grey(1.0), cxy: -0.5, cz: 0.5, n: 2.0 }.value(n, n)[1], 2.0 * FRAC_1_PI);
    near(Ggx { kd: grey(0.5), f0: grey(0.04), alpha: 0.1 }.value(n, n)[2], FRAC_1_PI * (0.5 + 0.04 / 0.04));
    // ((3 - 1)/(3 + 1))^2 = 1/4
    near(Abc { kd: grey(0.0), a: grey(8.0), b: 5.0, c: 1.0, eta: 3.0 }.value(n, n)[0], 2.0 * FRAC_1_PI);
    let mut sgd = [grey(0.0); 11];
    (sgd[1], sgd[2], sgd[4], sgd[6]) = (grey(1.0), grey(0.5), grey(1.0), grey(2.0));
    (sgd[7], sgd[8], sgd[9]) = (grey(1.0), grey(1.0), grey(1.0));
    near(Sgd::from_rows(sgd).expect("valid").value(n, n)[0], (-1.0f64).exp() * FRAC_1_PI * FRAC_1_PI);
}

/// Directional albedo by midpoint quadrature of f cos theta_o over the hemisphere, green channel.
fn albedo(model: &dyn AnalyticBrdf, theta_i: f64) -> f64 {
    let (rings, sectors) = (720, 720);
    let (d_theta, d_phi) = (0.5 * PI / rings as f64, 2.0 * PI / sectors as f64);
    let mut sum = 0.0;
    for ring in 0..rings {
        let theta = (ring as f64 + 0.5) * d_theta;
        for sector in 0..sectors {
            let (wi, wo) = standard_directions(theta_i, theta, (sector as f64 + 0.5) * d_phi);
            sum += model.value(wi, wo)[1] * wo.z * theta.sin() * d_theta * d_phi;
        }
    }
    sum
}

/// White furnace: with nothing absorbed, what comes back is at most what went in.
#[test]
fn models_that_claim_it_reflect_at_most_what_they_receive() {
    for theta_i in [0.1, 0.8, 1.3] {
        let lambert = albedo(&Lambert { kd: grey(1.0) }, theta_i);
        assert!((lambert - 1.0).abs() < 1e-5, "{lambert}");
        for alpha in [0.1, 0.3, 0.8] {
            let ggx = albedo(&Ggx { kd: grey(0.0), f0: grey(1.0), alpha }, theta_i);
            assert!(ggx <= 1.0 + 1e-3, "GGX {alpha} at {theta_i}: {ggx}");
        }
    }
    // A narrow lobe loses next to nothing to masking near the normal.
    let ggx = albedo(&Ggx { kd: grey(0.0), f0: grey(1.0), alpha: 0.1 }, 0.1);
    assert!(ggx > 0.98, "{ggx}");
    // Duer's form is normalised: the lobe reflects ks near the normal.
    let duer = albedo(&Ward { kd: grey(0.0), ks: grey(1.0), alpha: 0.1, form: WardForm::Duer }, 0.1);
    assert!((duer - 1.0).abs() < 0.03, "{duer}");
}
