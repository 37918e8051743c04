//! CPU time of `energy` beside `ot`, three channels of 45x45x180, on the golden pairs: with both sides prepared, with none, and of value
//! and gradient with the reference prepared. One thread, all in one run, so that the ratios hold on a busy machine.
//!
//! `cargo bench --bench energy`. Linux only: it reads the thread's CPU time from /proc.

#[path = "../../vernis-metric/tests/it/transport_golden.rs"]
#[allow(dead_code)]
mod transport_golden;
#[path = "../../vernis-metric/tests/it/transport_pairs.rs"]
#[allow(dead_code)]
mod transport_pairs;

use std::hint::black_box;
use std::sync::Arc;
use transport_golden::GOLDEN;
use transport_pairs::Model;
use vernis_metric::brdf::Brdf;
use vernis_metric::math::{Rgb, Vec3};
use vernis_metric::metric::Side;
use vernis_metric::metric::graph::{CosineTable, GraphMetric};
use vernis_metric::metric::kernel::KernelMetric;
use vernis_metric::metric::transport::TransportMetric;

/// The clock of a thread advances in steps of some milliseconds: what is measured takes many of them.
const LEAST: f64 = 250.0;
/// The shortest of so many measurements.
const RUNS: usize = 3;

/// One of the formulas of the golden pairs, by channel.
struct Models([Model; 3]);

impl Brdf for Models {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let phi_d = (wi.x * wo.y - wi.y * wo.x).atan2(wi.x * wo.x + wi.y * wo.y);
        Some(self.0.map(|model| model.value(wi.z.acos(), wo.z.acos(), phi_d)))
    }
}

/// CPU time of this thread, ms.
fn cpu_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("nanoseconds") * 1e-6
}

/// CPU time of one run, ms.
fn time<T>(mut run: impl FnMut() -> T) -> f64 {
    let measured = |_| {
        let (start, mut count) = (cpu_time(), 0.0);
        loop {
            black_box(run());
            count += 1.0;
            let spent = cpu_time() - start;
            if spent > LEAST {
                return spent / count;
            }
        }
    };
    (0..RUNS).map(measured).fold(f64::INFINITY, f64::min)
}

fn measure() {
    let energy = KernelMetric::named("energy").expect("a metric");
    let ot = TransportMetric::preset().expect("a metric");
    let mut means = [0.0; 6];
    println!("{:39}{:>16}{:>16}{:>16}", "CPU ms a pair: energy, ot", "both prepared", "none", "gradient");
    let line = |name: &str, t: [f64; 6]| {
        let [a, b, c, d, e, f] = t;
        println!("{name:39}{a:8.1}{b:8.1}{c:8.1}{d:8.1}{e:8.1}{f:8.1}");
    };
    for pair in &GOLDEN {
        let table = |models| Arc::new(CosineTable::of(&Models(models), ot.grid(), Side::Alone).expect("a table"));
        let tables = pair.models.map(table);
        let [reference, candidate] = &tables;
        let of_energy = || tables.each_ref().map(|t| energy.prepare_channels(t.clone()).expect("channels"));
        let of_ot = || tables.each_ref().map(|t| ot.prepare_channels(t, Side::Alone).expect("channels"));
        let between_energy = |[a, b]: &[_; 2]| energy.between(a, b).expect("divergences");
        let between_ot = |[a, b]: &[_; 2]| ot.between(a, b).expect("divergences");
        let (energies, ots) = (of_energy(), of_ot());
        let prepared = [
            energy.prepare_table(reference.clone()).expect("a reference"),
            ot.prepare_table(reference.clone()).expect("a reference"),
        ];
        let [of_energy_gradient, of_ot_gradient] =
            prepared.each_ref().map(|prepared| time(|| prepared.gradients(candidate).expect("gradients")));
        let times = [
            time(|| between_energy(&energies)),
            time(|| between_ot(&ots)),
            time(|| between_energy(&of_energy())),
            time(|| between_ot(&of_ot())),
            of_energy_gradient,
            of_ot_gradient,
        ];
        line(pair.name, times);
        means.iter_mut().zip(times).for_each(|(mean, time)| *mean += time / GOLDEN.len() as f64);
    }
    line("mean", means);
    let [a, b, c, d, e, f] = means;
    println!("energy/ot: {:.2} with both sides prepared, {:.2} with none, {:.2} with gradient", a / b, c / d, e / f);
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread").install(measure);
}
