//! Add several metrics that share work: differences of the light that a surface returns in all directions, at several angles of
//! incidence. Each is a metric of its own; asked for together, they evaluate each BRDF once.
//!
//! ```text
//! cargo run --release --no-default-features --example share_a_pass
//! ```

use std::error::Error;
use std::f64::consts::PI;
use std::sync::Arc;
use vernis::brdf::Brdf;
use vernis::brdf::models::Ggx;
use vernis::math::Vec3;
use vernis::math::color::luminance;
use vernis::metric::registry::{Registry, distances};
use vernis::metric::{Measured, Metric, MetricError, PreparedMetric, PreparedShare, Properties, Share};

/// |albedo_candidate - albedo_reference| at one angle of incidence, luminance, without unit.
struct AlbedoDifference {
    name: String,
    /// From the normal, degrees.
    angle: f64,
}

impl AlbedoDifference {
    fn new(angle: f64) -> Self {
        Self { name: format!("albedo-{angle}"), angle }
    }
}

/// Integral of f cos theta_o over the hemisphere for light from each of `angles`, by the midpoint rule. The directions of the
/// viewer are made once for all angles.
fn albedos(brdf: &dyn Brdf, angles: &[f64]) -> Vec<f64> {
    const RINGS: usize = 64;
    const SECTORS: usize = 128;
    let mut sums = vec![0.0; angles.len()];
    for ring in 0..RINGS {
        let theta = (ring as f64 + 0.5) / RINGS as f64 * PI / 2.0;
        for sector in 0..SECTORS {
            let viewer = Vec3::from_spherical(theta, (sector as f64 + 0.5) / SECTORS as f64 * 2.0 * PI);
            let solid_angle = theta.sin() * (PI / 2.0 / RINGS as f64) * (2.0 * PI / SECTORS as f64);
            for (sum, angle) in sums.iter_mut().zip(angles) {
                let light = Vec3::from_spherical(angle.to_radians(), 0.0);
                // What was not measured is left out.
                let value = brdf.eval(light, viewer).map_or(0.0, luminance);
                *sum += value * viewer.z * solid_angle;
            }
        }
    }
    sums
}

/// Several angles, the reference fixed.
struct Together {
    angles: Vec<f64>,
    reference: Vec<f64>,
}

/// Makes one pass over the reference for all metrics that share it.
fn together(angles: Vec<f64>, reference: &dyn Brdf) -> Result<Box<dyn PreparedShare>, MetricError> {
    let reference = albedos(reference, &angles);
    Ok(Box::new(Together { angles, reference }))
}

impl PreparedShare for Together {
    fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
        let candidate = albedos(candidate, &self.angles);
        Ok(candidate.iter().zip(&self.reference).map(|(c, r)| Measured::distance((c - r).abs())).collect())
    }
}

/// One angle alone.
struct Alone(Box<dyn PreparedShare>);

impl PreparedMetric for Alone {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        Ok(self.0.measure(candidate)?[0].value)
    }
}

impl Metric for AlbedoDifference {
    fn name(&self) -> &str {
        &self.name
    }

    fn version(&self) -> &str {
        "1"
    }

    fn properties(&self) -> Properties {
        Properties {
            family: "albedo",
            unit: "1",
            symmetric: true,
            usable_as_loss: true,
            summary: format!("difference of the albedo at {} degrees", self.angle),
            source: "an example",
            ..Properties::default()
        }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Alone(together(vec![self.angle], reference)?)))
    }

    /// All metrics that name the same work are prepared by one call of `together`.
    fn share(&self) -> Option<Share> {
        Some(Share::new("albedo", self.angle, together))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut registry = Registry::standard()?;
    for angle in [0.0, 30.0, 60.0] {
        registry.add(Arc::new(AlbedoDifference::new(angle)))?;
    }
    let names = ["albedo-0", "albedo-30", "albedo-60", "D9.Cl", "D4.Cl"];
    let metrics = names.map(|name| registry.get(name)).into_iter().collect::<Result<Vec<_>, _>>()?;
    let smooth = Ggx::new([0.1; 3], [0.04; 3], 0.1)?;
    let rough = Ggx::new([0.1; 3], [0.04; 3], 0.3)?;
    for distance in distances(&metrics, &smooth, &rough)? {
        println!("{:10} {:.4}", distance.metric, distance.value);
    }
    Ok(())
}
