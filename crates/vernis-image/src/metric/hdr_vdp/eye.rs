//! The eye of HDR-VDP-2: scatter, the receptors' response to light, and the sensitivity of what follows.
//!
//! Source: Mantiuk, Kim, Rempel and Heidrich 2011, sections 4.1 to 4.3 (doi:10.1145/2010324.1964935), with the parameters of version
//! 2.2.0 of the authors' program.

use std::sync::LazyLock;

/// Channels of light to L, M and rods: sRGB primaries of an LCD with a CCFL backlight, integrals over Smith and Pokorny's cones (1975)
/// and the CIE's V' (1951).
pub(super) const RECEPTORS_FROM_RGB: [[f64; 3]; 3] = [
    [0.198996120338, 0.404762607038, 0.0543906192553],
    [0.0410058604076, 0.254923306441, 0.0500122489593],
    [0.0143773686211, 0.480920841084, 0.454275895669],
];

/// The same of luminance with the spectrum of D65.
pub(super) const RECEPTORS_FROM_LUMINANCE: [f64; 3] = [0.601847152245, 0.316708295579, 0.9046706546];

/// How much of a contrast of `rho` cycles a degree the optics leave (equation 1).
pub(super) fn scatter(rho: f64) -> f64 {
    // Two numbers of an earlier form from which the weights follow.
    const FAR: f64 = 0.061466549455263;
    const NEAR: f64 = 0.997_273_700_237_770_7;
    const WEIGHTS: [f64; 4] = [NEAR * 0.426, NEAR * 0.574, (1.0 - NEAR) * FAR, (1.0 - NEAR) * (1.0 - FAR)];
    const SCALES: [f64; 4] = [0.028, 0.37, 37.0, 360.0];
    WEIGHTS.iter().zip(SCALES).map(|(a, b)| a * (-b * rho).exp()).sum()
}

/// Sensitivity of cones and rods together, by luminance in cd/m2 (equation 6).
pub(super) fn joint_sensitivity(luminance: f64) -> f64 {
    30.162 * ((4.0627 / luminance).powf(1.6596) + 1.0).powf(-0.2712)
}

/// Sensitivity of rods (equation 8).
pub(super) fn rod_sensitivity(luminance: f64) -> f64 {
    let (scale, exponent) = if luminance > 1.1732 { (0.5547, 2.9899) } else { (1.1478, 1.2167) };
    let distance = (luminance / 1.1732).log10().abs();
    (-distance.powf(exponent) / scale).exp() * 10f64.powf(1.1414)
}

/// Luminances at which the parameters of [`neural_sensitivity`] were fitted, cd/m2.
const LUMINANCES: [f64; 6] = [0.002, 0.02, 0.2, 2.0, 20.0, 150.0];
/// The parameters.
const PARAMETERS: [[f64; 4]; 6] = [
    [0.991265, 3.74038, 0.50722, 4.46044],
    [0.800889, 3.54104, 0.682505, 4.94958],
    [0.476505, 4.37453, 0.750315, 5.28678],
    [0.405782, 4.40602, 0.935314, 5.61425],
    [0.334278, 3.79542, 1.07327, 6.4635],
    [0.394533, 2.7755, 1.16577, 7.45665],
];

/// Sensitivity of what follows the receptors, to `rho` cycles a degree at a luminance in cd/m2 (equation 10).
pub(super) fn neural_sensitivity(rho: f64, luminance: f64) -> f64 {
    let last = LUMINANCES.len() - 1;
    let log = luminance.clamp(LUMINANCES[0], LUMINANCES[last]).log10();
    let i = (1..last).find(|i| log < LUMINANCES[*i].log10()).unwrap_or(last) - 1;
    let (from, to) = (LUMINANCES[i].log10(), LUMINANCES[i + 1].log10());
    let t = (log - from) / (to - from);
    let [p1, p2, p3, p4]: [f64; 4] =
        std::array::from_fn(|k| PARAMETERS[i][k] + t * (PARAMETERS[i + 1][k] - PARAMETERS[i][k]));
    let high = 1.0 + (p1 * rho).powf(p2);
    let low = (1.0 - (-(rho / 7.0).powi(2)).exp()).powf(p3);
    // At no frequency `low` is 0, and so is the sensitivity.
    p4 / (high / low).sqrt()
}

/// Logarithms of the luminances between which responses are interpolated.
pub(super) const LOG_RANGE: (f64, f64) = (-5.0, 5.0);
/// How many there are.
const SAMPLES: usize = 2048;
/// Daly's peak sensitivity over that of the model.
const CORRECTION: f64 = 0.006894596 / 0.003_981_071_705_534_973;

/// The response of a receptor, in just noticeable differences of light: the integral of sensitivity over luminance (equation 5).
pub(super) struct Response(Vec<f64>);

/// That of L and M cones each.
pub(super) static CONE: LazyLock<Response> = LazyLock::new(|| {
    // Half of the cones' sensitivity at twice the light: L and M share it.
    let light: Vec<f64> = (0..SAMPLES).map(sample).collect();
    let cones: Vec<f64> = light.iter().map(|l| (joint_sensitivity(*l) - rod_sensitivity(*l)).max(1e-3)).collect();
    let at = |l: f64| {
        let l = l.min(light[SAMPLES - 1]);
        let i = light.partition_point(|x| *x <= l).clamp(1, SAMPLES - 1) - 1;
        let t = (l - light[i]) / (light[i + 1] - light[i]);
        cones[i] + t * (cones[i + 1] - cones[i])
    };
    Response::integral(light.iter().map(|l| 0.5 * at(2.0 * l)))
});

/// That of rods.
pub(super) static ROD: LazyLock<Response> =
    LazyLock::new(|| Response::integral((0..SAMPLES).map(sample).map(rod_sensitivity)));

fn sample(i: usize) -> f64 {
    10f64.powf(LOG_RANGE.0 + i as f64 * step())
}

fn step() -> f64 {
    (LOG_RANGE.1 - LOG_RANGE.0) / (SAMPLES - 1) as f64
}

impl Response {
    /// Of the sensitivity at each sample; over the logarithm of luminance, by trapezia.
    fn integral(sensitivity: impl Iterator<Item = f64>) -> Self {
        let mut sum = 0.0;
        let mut before = None;
        let rises = sensitivity.map(|s| {
            let slope = s * std::f64::consts::LN_10;
            sum += before.replace(slope).map_or(0.0, |before| 0.5 * step() * (before + slope));
            sum * CORRECTION
        });
        Self(rises.collect())
    }

    /// At a luminance in cd/m2, held to the range.
    pub fn at(&self, luminance: f64) -> f64 {
        let log = luminance.clamp(1e-5, 1e5).log10();
        let place = (log - LOG_RANGE.0) / step();
        let i = (place as usize).min(SAMPLES - 2);
        self.0[i] + (place - i as f64) * (self.0[i + 1] - self.0[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of version 2.2.0 of the authors' program, run in Octave 7.3: luminances down, cycles a degree across.
    #[test]
    fn sensitivities_agree_with_the_authors() {
        let frequencies = [0.5, 4.0, 30.0];
        for (luminance, expected) in [
            (0.01, [0.889738297204, 0.346492808764, 0.01384956677]),
            (1.0, [0.540387486032, 0.925867212701, 0.0202648196481]),
            (1000.0, [0.341499398488, 1.66002813796, 0.241532809422]),
        ] {
            for (rho, expected) in frequencies.iter().zip(expected) {
                let found = neural_sensitivity(*rho, luminance);
                assert!((found / expected - 1.0).abs() < 1e-10, "{rho} {luminance}: {found} {expected}");
            }
        }
        for (rho, expected) in [(0.0, 1.0), (1.0, 0.808508687162), (8.0, 0.369242886926), (60.0, 0.0791788584984)] {
            assert!((scatter(rho) - expected).abs() < 1e-11, "{rho}");
        }
        for (luminance, joint, rod) in [
            (0.001, 0.716460030648, 0.457666739841),
            (1.0, 15.6484137358, 13.3868163103),
            (100.0, 30.1219515214, 3.50464670961e-05),
        ] {
            assert!((joint_sensitivity(luminance) / joint - 1.0).abs() < 1e-10, "{luminance}");
            assert!((rod_sensitivity(luminance) / rod - 1.0).abs() < 1e-10, "{luminance}");
        }
        assert_eq!(neural_sensitivity(0.0, 10.0), 0.0);
    }

    #[test]
    fn responses_rise_with_light() {
        for response in [&*CONE, &*ROD] {
            let values: Vec<f64> = (-60..=60).map(|i| response.at(10f64.powf(f64::from(i) / 10.0))).collect();
            assert!(values.windows(2).all(|v| v[0] <= v[1]));
            assert_eq!(values[0], 0.0);
        }
    }
}
