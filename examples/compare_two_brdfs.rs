//! Compare two BRDFs by classical metrics, all Lp variants in one pass.
//!
//! ```text
//! cargo run --release --no-default-features --example compare_two_brdfs
//! cargo run --release --no-default-features --example compare_two_brdfs -- alum-bronze.binary ward.json
//! ```

use std::error::Error;
use std::sync::Arc;
use vernis::brdf::models::{BlinnPhong, Ggx};
use vernis::brdf::{Brdf, BrdfSource};
use vernis::metric::registry::{Registry, distances};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (reference, candidate): (Arc<dyn Brdf>, Arc<dyn Brdf>) = match arguments.as_slice() {
        [reference, candidate] => {
            (BrdfSource::parse(reference)?.open(None)?.brdf, BrdfSource::parse(candidate)?.open(None)?.brdf)
        }
        _ => (
            Arc::new(Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.1)?),
            Arc::new(BlinnPhong::new([0.2, 0.1, 0.05], [0.04; 3], 250.0)?),
        ),
    };
    let registry = Registry::standard()?;
    let mut metrics = registry.resolve("all-lp")?;
    metrics.extend(registry.resolve("vernis")?);
    for distance in distances(&metrics, reference.as_ref(), candidate.as_ref())? {
        match distance.score {
            Some(s) => println!("{:10} {:.4}  predicted MOS {:.2} of 5", distance.metric, distance.value, s.mos),
            None => println!("{:10} {:.4}", distance.metric, distance.value),
        }
    }
    Ok(())
}
