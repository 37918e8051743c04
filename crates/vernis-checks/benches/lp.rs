//! The fused Lp pass against 36 passes of the formulas as they are written, in the same run.
//!
//! `cargo bench --bench lp` prints times and ratios.

#[path = "../../vernis-metric/tests/it/naive_lp.rs"]
mod naive_lp;

use std::f64::consts::PI;
use std::hint::black_box;
use std::time::{Duration, Instant};
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, Vec3};
use vernis_metric::metric::Metric;
use vernis_metric::metric::lp::{LpDistances, LpMetric, LpVariant};
use vernis_metric::metric::registry::{Registry, distances};

/// A diffuse base under a Blinn-Phong lobe.
struct Glossy {
    exponent: f64,
}

impl Brdf for Glossy {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let h = (wi + wo).normalized();
        let lobe = 0.1 * (self.exponent + 2.0) / (2.0 * PI) * h.z.powf(self.exponent);
        Some([0.3, 0.2, 0.05].map(|kd| kd / PI + lobe))
    }
}

/// The shortest of several runs.
fn shortest(runs: usize, mut run: impl FnMut()) -> Duration {
    let timed = |_| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..runs).map(timed).min().unwrap_or_default()
}

fn main() {
    let table = |exponent| TabulatedBrdf::tabulate(&Glossy { exponent }, Grid::TITOPO).expect("a valid BRDF");
    let (reference, candidate) = (table(200.0), table(150.0));
    let in_pool = |threads: usize, run: &(dyn Fn() + Sync)| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| shortest(7, run))
    };
    #[cfg(target_arch = "x86_64")]
    println!("AVX2: {}", std::arch::is_x86_feature_detected!("avx2"));
    println!("two tables of 90 x 90 x 360 RGB, best of 7 (naive: 1)");

    let naive = shortest(1, || {
        LpVariant::of_study().for_each(|variant| {
            black_box(naive_lp::distance(variant, &reference, &candidate));
        });
    });
    println!("36 naive passes, 1 thread   {:8.1} ms", naive.as_secs_f64() * 1e3);
    let study = Registry::standard().unwrap().resolve("all-lp").expect("a group");
    for threads in [1, 2] {
        let fused = in_pool(threads, &|| {
            black_box(distances(&study, &reference, &candidate).expect("distances"));
        });
        let ratio = naive.as_secs_f64() / fused.as_secs_f64();
        println!("all 36 fused, {threads} thread(s)  {:8.1} ms   {ratio:6.1} x faster", fused.as_secs_f64() * 1e3);
    }
    let with_lab = in_pool(2, &|| {
        black_box(LpDistances::between(&reference, &candidate).expect("distances"));
    });
    println!("36 and CIELAB, 2 threads   {:8.1} ms", with_lab.as_secs_f64() * 1e3);
    for name in ["D1", "D9.Cl", "D1.Cl.CR", "D6", "lab"] {
        let metric = LpMetric::new(name.parse().expect("a name"));
        let prepared = metric.prepare(&reference).expect("prepared");
        let time = in_pool(2, &|| {
            black_box(prepared.distance(&candidate).expect("a distance"));
        });
        println!("{name:9} alone, 2 threads  {:8.1} ms", time.as_secs_f64() * 1e3);
    }
}
