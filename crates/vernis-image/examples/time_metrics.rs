//! How long each metric takes for a pair of pictures, reading apart: the median of some runs, as JSON.
//!
//!   cargo run --release -p vernis-image --example time_metrics -- REF TEST [THREADS [RUNS [METRIC...]]]
//!
//! The environment variable VERNIS_WEIGHTS may name a folder with weights of networks (feature `networks`); each network is read before
//! its time is taken. `experiments/peers/image_metrics.py` shows the times of other programs beside these.

use serde_json::{Map, Value, json};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use vernis_image::metric::{Conditions, ImageRegistry, Weights};
use vernis_image::picture::read::read;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [reference, test, rest @ ..] = &arguments[..] else {
        return Err("REF TEST [THREADS [RUNS [METRIC...]]]".into());
    };
    let number = |i: usize, default: usize| rest.get(i).map_or(Ok(default), |text| text.parse());
    let (threads, runs) = (number(0, 0)?, number(1, 7)?);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let (reference, test) = (read(Path::new(reference))?, read(Path::new(test))?);
    let weights = std::env::var_os("VERNIS_WEIGHTS").map(|folder| Weights::in_folder(Path::new(&folder)));
    let conditions = Conditions { weights: weights.transpose()?.map(Arc::new), ..Conditions::default() };
    let mut milliseconds = Map::new();
    let named = |name: &str| rest.len() < 3 || rest[2..].iter().any(|n| n == name);
    for metric in ImageRegistry::standard().applicable(reference.encoding(), &conditions) {
        if !named(metric.name()) {
            continue;
        }
        metric.prepare(&reference, &conditions)?;
        let mut times = Vec::new();
        for _ in 0..runs.max(1) {
            let start = Instant::now();
            metric.prepare(&reference, &conditions)?.compare(&test, false)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        milliseconds.insert(metric.name().to_owned(), json!(times[times.len() / 2]));
    }
    let threads = rayon::current_num_threads();
    println!(
        "{}",
        Value::Object(Map::from_iter([
            ("threads".to_owned(), json!(threads)),
            ("milliseconds".to_owned(), Value::Object(milliseconds))
        ]))
    );
    Ok(())
}
