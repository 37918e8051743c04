//! Add a metric of one's own: the difference of the luminance that a BRDF reflects towards the viewer, head on.
//!
//! ```text
//! cargo run --release --no-default-features --example add_a_metric
//! ```

use std::error::Error;
use std::sync::Arc;
use vernis::brdf::Brdf;
use vernis::brdf::models::Ggx;
use vernis::math::Vec3;
use vernis::math::color::luminance;
use vernis::metric::registry::{Registry, distances};
use vernis::metric::{Metric, MetricError, PreparedMetric, Properties, Side};

/// |ln(Y_candidate + 1e-3) - ln(Y_reference + 1e-3)| with both directions along the normal.
struct HeadOn;

fn log_luminance(brdf: &dyn Brdf, side: Side) -> Result<f64, MetricError> {
    let normal = Vec3::new(0.0, 0.0, 1.0);
    match brdf.eval(normal, normal) {
        Some(value) => Ok((luminance(value) + 1e-3).ln()),
        None => Err(MetricError::Unusable { side, reason: "no measurement along the normal".to_owned() }),
    }
}

impl Metric for HeadOn {
    fn name(&self) -> &str {
        "head-on"
    }

    /// To be raised whenever a distance changes.
    fn version(&self) -> &str {
        "1"
    }

    fn properties(&self) -> Properties {
        Properties {
            unit: "ln",
            symmetric: true,
            summary: "log luminance ratio with light and viewer along the normal".to_owned(),
            source: "an example",
            ..Properties::default()
        }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Prepared(log_luminance(reference, Side::Reference)?)))
    }
}

/// What is known of the reference.
struct Prepared(f64);

impl PreparedMetric for Prepared {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        Ok((log_luminance(candidate, Side::Candidate)? - self.0).abs())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut registry = Registry::standard()?;
    registry.add(Arc::new(HeadOn))?;
    let metrics = [registry.get("head-on")?, registry.get("D9.Cl")?];
    let smooth = Ggx::new([0.1; 3], [0.04; 3], 0.1)?;
    let rough = Ggx::new([0.1; 3], [0.04; 3], 0.3)?;
    for distance in distances(&metrics, &smooth, &rough)? {
        println!("{:8} {:.4}", distance.metric, distance.value);
    }
    Ok(())
}
