//! Use an exported metric as the loss of a fit: which roughness makes a GGX lobe look most like a Ward one? No training
//! crate is needed.
//!
//! ```text
//! cargo run --release --no-default-features --example use_exported_metric [-- METRIC.vernis.json]
//! ```

use std::error::Error;
use std::path::Path;
use vernis::brdf::models::{Ggx, Ward, WardForm};
use vernis::metric::Metric;
use vernis::metric::learned::LearnedMetric;

fn main() -> Result<(), Box<dyn Error>> {
    let metric = match std::env::args().nth(1) {
        Some(path) => LearnedMetric::load(Path::new(&path))?,
        None => LearnedMetric::shipped()?,
    };
    println!("{}: {}", metric.name(), metric.properties().summary);
    let reference = Ward::new([0.2, 0.1, 0.05], [0.05; 3], 0.15, WardForm::Ward)?;
    // The reference is paid for once.
    let prepared = metric.prepare(&reference)?;
    let mut best = (f64::INFINITY, 0.0);
    for step in 0..20 {
        let alpha = 0.05 + 0.015 * f64::from(step);
        let distance = prepared.distance(&Ggx::new([0.2, 0.1, 0.05], [0.04; 3], alpha)?)?;
        println!("alpha {alpha:.3}: {distance:.3} MOS below identical");
        if distance < best.0 {
            best = (distance, alpha);
        }
    }
    println!("best: alpha {:.3}", best.1);
    Ok(())
}
