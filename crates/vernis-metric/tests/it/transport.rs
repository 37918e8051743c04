//! The Sinkhorn divergence against GeomLoss, against sums over all pairs, and against theory.

use crate::transport_golden::GOLDEN;
use crate::transport_golden_p1::GOLDEN_OF_DISTANCE;
use crate::transport_pairs::{self as pairs, Model};
use vernis_metric::metric::graph::GraphGrid;
use vernis_metric::metric::transport::{
    Accuracy, GroundCost, Method, PreparedChannel, SinkhornParameters, TransportError, divergence,
    divergence_and_gradient,
};

fn study() -> SinkhornParameters {
    SinkhornParameters::new(GroundCost::SquaredDistance, 0.1, 0.05, 0.8).unwrap()
}

fn fourth_root(t: f64) -> f64 {
    t.sqrt().sqrt()
}

fn between(parameters: &SinkhornParameters, grid: GraphGrid, a: &[f64], b: &[f64]) -> f64 {
    let prepare = |values| PreparedChannel::new(parameters, grid, values, None).unwrap();
    divergence(parameters, &prepare(a), &prepare(b)).unwrap()
}

/// The largest relative error over the golden channels of one grid.
fn worst_golden(parameters: &SinkhornParameters, grid: GraphGrid, channels: usize) -> f64 {
    let mut worst: f64 = 0.0;
    for pair in GOLDEN {
        let divergences = match grid.to_string().as_str() {
            "6x6x24" => pair.on_6x6x24,
            "9x9x36" => pair.on_9x9x36,
            other => panic!("no golden values on {other}"),
        };
        for (channel, expected) in divergences.into_iter().enumerate().take(channels) {
            let [a, b] = pair.models.map(|models| models[channel].graph(grid, fourth_root));
            let found = between(parameters, grid, &a, &b);
            println!("{grid} {} {channel}: {found:e} {expected:e} {:.1e}", pair.name, found / expected - 1.0);
            if expected == 0.0 {
                assert_eq!(found, 0.0);
            } else {
                worst = worst.max((found / expected - 1.0).abs());
            }
        }
    }
    worst
}

#[test]
fn default_accuracy_is_within_one_per_cent_of_geomloss() {
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&study(), grid.parse().unwrap(), 3);
        assert!(worst < 0.01, "{grid}: {worst}");
    }
}

#[test]
fn high_accuracy_is_within_a_thousandth_of_geomloss() {
    let parameters = study().with_accuracy(Accuracy::high(0.1, 0.05)).unwrap();
    // The green and blue channels of the larger grid take half a minute.
    for (grid, channels) in [("6x6x24", 3), ("9x9x36", 1)] {
        let worst = worst_golden(&parameters, grid.parse().unwrap(), channels);
        assert!(worst < 0.001, "{grid}: {worst}");
    }
}

#[test]
fn fast_accuracy_is_within_four_per_cent_of_geomloss() {
    let parameters = study().with_accuracy(Accuracy::fast(0.1, 0.05)).unwrap();
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&parameters, grid.parse().unwrap(), 3);
        assert!(worst < 0.04, "{grid}: {worst}");
    }
}

/// At the default accuracy every cell of these grids is a cluster.
#[test]
fn distances_agree_with_geomloss() {
    for golden in &GOLDEN_OF_DISTANCE {
        let parameters = parameters(GroundCost::Distance, golden.alpha, golden.blur, golden.scaling);
        let (grid, channels) = (golden.grid.parse::<GraphGrid>().unwrap(), if golden.grid == "6x6x24" { 3 } else { 1 });
        assert_eq!(parameters.method(grid).unwrap(), Method::Direct);
        for (pair, expected) in golden.divergences {
            for (channel, expected) in expected.into_iter().enumerate().take(channels) {
                let [a, b] = GOLDEN[pair].models.map(|models| models[channel].graph(grid, fourth_root));
                let found = between(&parameters, grid, &a, &b);
                // Seven digits; the smallest divergence is 2e-7 of potentials of 1.
                assert!((found / expected - 1.0).abs() < 1e-6, "{} {pair} {channel}: {found} {expected}", golden.grid);
            }
        }
    }
}

/// Of 2,916 cells, against the sums over all pairs that GeomLoss took.
#[test]
fn clusters_are_near_geomloss() {
    let golden = GOLDEN_OF_DISTANCE.iter().filter(|golden| golden.grid == "9x9x36");
    for (golden, (clusters, tolerance)) in
        golden.flat_map(|golden| [(1800, 0.01), (900, 0.03)].map(|limit| (golden, limit)))
    {
        let parameters = parameters(GroundCost::Distance, golden.alpha, golden.blur, golden.scaling);
        let parameters = parameters.with_accuracy(Accuracy { clusters, ..parameters.accuracy() }).unwrap();
        let grid = golden.grid.parse::<GraphGrid>().unwrap();
        assert_eq!(parameters.method(grid).unwrap(), Method::Clustered { clusters });
        for (pair, [expected, ..]) in golden.divergences {
            let [a, b] = GOLDEN[pair].models.map(|models| models[0].graph(grid, fourth_root));
            let found = between(&parameters, grid, &a, &b);
            println!("{clusters} {} {} {pair}: {:.2e}", golden.alpha, golden.blur, found / expected - 1.0);
            assert!(
                (found / expected - 1.0).abs() < tolerance,
                "{clusters} {} {pair}: {found} {expected}",
                golden.alpha
            );
            assert_eq!(between(&parameters, grid, &a, &a), 0.0);
            let back = between(&parameters, grid, &b, &a);
            assert!((found - back).abs() <= 1e-9 * found, "{found} {back}");
        }
    }
}

/// Of 6,912 cells, against sums over all of them, which agree with GeomLoss on the grids of its values; of 4,608 where epsilon falls
/// fast, and slowly.
#[test]
fn what_clusters_settle_to_is_near_sums_over_all_cells() {
    let (standard, few) = (Accuracy::standard(0.1, 0.05).clusters, 3000);
    let (large, small) = (grid(12, 12, 48), grid(12, 12, 32));
    let all_pairs = 0..GOLDEN.len();
    for (grid, scaling, clusters, pairs) in
        [(large, 0.8, standard, all_pairs), (small, 0.3, few, 1..3), (small, 0.95, few, 1..3)]
    {
        let with = |clusters: usize| {
            let parameters = parameters(GroundCost::Distance, 0.1, 0.05, scaling);
            parameters.with_accuracy(Accuracy { clusters, ..parameters.accuracy() }).unwrap()
        };
        let (clustered, all) = (with(clusters), with(grid.len()));
        assert_eq!(clustered.method(grid).unwrap(), Method::Clustered { clusters });
        assert_eq!(all.method(grid).unwrap(), Method::Direct);
        for pair in &GOLDEN[pairs] {
            let [a, b] = pair.models.map(|models| models[0].graph(grid, fourth_root));
            let (found, expected) = (between(&clustered, grid, &a, &b), between(&all, grid, &a, &b));
            println!("{scaling} {}: {found:e} {expected:e} {:.1e}", pair.name, found / expected - 1.0);
            assert!((found - expected).abs() <= 1e-3 * expected, "{scaling} {}: {found} {expected}", pair.name);
            let back = between(&clustered, grid, &b, &a);
            assert!((found - back).abs() <= 1e-9 * found, "{scaling} {}: {found} {back}", pair.name);
            assert_eq!(between(&clustered, grid, &b, &b), 0.0);
        }
    }
}

/// Epsilons that fall by more than sums of exponentials allow: each softmin by itself.
#[test]
fn steep_annealings_agree_with_sums_over_all_pairs() {
    let grid = grid(4, 4, 10);
    for (cost, scaling) in [(GroundCost::Distance, 1e-3), (GroundCost::SquaredDistance, 0.02)] {
        let steep = parameters(cost, 0.1, 0.01, scaling);
        for (a, b) in PAIRS {
            let (a, b) = (a.graph(grid, |t| 30.0 * t), b.graph(grid, |t| 30.0 * t));
            let (found, expected) = (between(&steep, grid, &a, &b), brute_force(&steep, grid, &a, &b));
            assert!((found - expected).abs() <= 1e-9 * expected.abs() + 1e-12, "{cost:?}: {found} {expected}");
        }
    }
}

/// Few cells are the hard case: on 45 x 45 x 180 it is within 2 % of the default.
#[test]
fn coarse_accuracy_is_within_a_few_per_cent_of_geomloss() {
    let parameters = study().with_accuracy(Accuracy::coarse(0.1, 0.05)).unwrap();
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&parameters, grid.parse().unwrap(), 3);
        assert!(worst < 0.05, "{grid}: {worst}");
    }
    let of_study: GraphGrid = GraphGrid::STUDY;
    for index in [0, 5] {
        let [a, b] = GOLDEN[index].models.map(|models| models[0].graph(of_study, fourth_root));
        let (coarse, default) = (between(&parameters, of_study, &a, &b), between(&study(), of_study, &a, &b));
        assert!((coarse / default - 1.0).abs() < 0.02, "{}: {coarse} {default}", GOLDEN[index].name);
    }
}

fn grid(theta_i: usize, theta_o: usize, phi_d: usize) -> GraphGrid {
    GraphGrid::new(theta_i, theta_o, phi_d).unwrap()
}

fn parameters(cost: GroundCost, alpha: f64, blur: f64, scaling: f64) -> SinkhornParameters {
    SinkhornParameters::new(cost, alpha, blur, scaling).unwrap()
}

/// Sums over all pairs, with the standard library.
fn brute_force(parameters: &SinkhornParameters, grid: GraphGrid, a: &[f64], b: &[f64]) -> f64 {
    let points = |values| pairs::points(grid, parameters.alpha(), values);
    let p = if parameters.cost() == GroundCost::Distance { 1 } else { 2 };
    pairs::divergence(p, parameters.blur(), parameters.scaling(), &points(a), &points(b))
}

/// The relative error against [`brute_force`].
fn error(parameters: &SinkhornParameters, grid: GraphGrid, pair: (Model, Model), phi: fn(f64) -> f64) -> f64 {
    let (a, b) = (pair.0.graph(grid, phi), pair.1.graph(grid, phi));
    between(parameters, grid, &a, &b) / brute_force(parameters, grid, &a, &b) - 1.0
}

/// Rough and smooth, far apart and nearly equal.
const PAIRS: [(Model, Model); 7] = [
    (Model::Ggx { a: 0.15, kd: 0.2, f0: 0.04 }, Model::Ggx { a: 0.2, kd: 0.22, f0: 0.05 }),
    (Model::Ggx { a: 0.1, kd: 0.0, f0: 0.9 }, Model::Ward { a: 0.12, kd: 0.02, ks: 0.8 }),
    (Model::Blinn { n: 60.0, kd: 0.1, ks: 0.3 }, Model::Blinn { n: 80.0, kd: 0.1, ks: 0.25 }),
    (Model::Lambert { kd: 0.4 }, Model::Ggx { a: 0.4, kd: 0.38, f0: 0.04 }),
    (Model::Lambert { kd: 0.01 }, Model::Lambert { kd: 0.9 }),
    (Model::Ward { a: 0.3, kd: 0.1, ks: 0.2 }, Model::Ward { a: 0.3003, kd: 0.1, ks: 0.2 }),
    (Model::Ggx { a: 0.25, kd: 0.3, f0: 0.1 }, Model::Ggx { a: 0.2501, kd: 0.3, f0: 0.1 }),
];

/// A grid that is summed directly at the default accuracy, and one that is quantised.
fn small_and_large() -> [GraphGrid; 2] {
    let grids = [grid(6, 5, 14), grid(8, 9, 26)];
    let direct = grids.map(|grid| study().method(grid).unwrap() == Method::Direct);
    assert_eq!(direct, [true, false]);
    grids
}

#[test]
fn further_pairs_agree_with_sums_over_all_pairs() {
    for (grid, tolerance) in small_and_large().into_iter().zip([1e-6, 0.01]) {
        for pair in PAIRS {
            let found = error(&study(), grid, pair, fourth_root);
            println!("{grid} {pair:?}: {found:.1e}");
            assert!(found.abs() < tolerance, "{grid} {pair:?}: {found}");
        }
    }
}

/// Differences of potentials lose ten digits here.
#[test]
fn nearly_equal_channels_keep_relative_precision() {
    for (grid, step) in small_and_large().into_iter().zip([1e-6, 1e-4]) {
        let pair = (Model::Ggx { a: 0.2, kd: 0.2, f0: 0.1 }, Model::Ggx { a: 0.2 + step, kd: 0.2, f0: 0.1 });
        let (a, b) = (pair.0.graph(grid, fourth_root), pair.1.graph(grid, fourth_root));
        let (found, expected) = (between(&study(), grid, &a, &b), brute_force(&study(), grid, &a, &b));
        println!("{step}: {found:e} {expected:e}");
        assert!(expected < 1e-9 && (found / expected - 1.0).abs() < 0.01, "{step}: {found:e} {expected:e}");
    }
}

#[test]
fn corners_of_the_paper_s_grid_agree_with_sums_over_all_pairs() {
    let logarithm: fn(f64) -> f64 = |t| (t + 0.01).ln();
    let tones: [fn(f64) -> f64; 5] = [|t| t, f64::sqrt, f64::cbrt, fourth_root, logarithm];
    let mut combination = 0;
    for alpha in [0.01, 0.05, 0.1, 1.0] {
        for blur in [0.01, 0.02, 0.05, 0.1] {
            // Coarse enough for sums over all pairs, fine enough to be quantised wherever that holds.
            let coarse = Accuracy { values_per_blur: 8, ..Accuracy::standard(alpha, blur) };
            let parameters = parameters(GroundCost::SquaredDistance, alpha, blur, 0.8).with_accuracy(coarse).unwrap();
            let (pair, tone) = (PAIRS[combination % 3], combination % 5);
            let found = error(&parameters, grid(8, 8, 26), pair, tones[tone]);
            println!("alpha {alpha} blur {blur} pair {} tone {tone}: {found:.1e}", combination % 3);
            assert!(found.abs() < 0.01, "alpha {alpha} blur {blur} pair {} tone {tone}: {found}", combination % 3);
            combination += 1;
        }
    }
}

/// Of a slow annealing most updates take place on coarser levels than their epsilons ask for.
#[test]
fn slow_annealings_agree_with_sums_over_all_pairs() {
    let slow = parameters(GroundCost::SquaredDistance, 0.1, 0.1, 0.95);
    let large = grid(8, 9, 26);
    assert_ne!(slow.method(large).unwrap(), Method::Direct);
    for pair in &PAIRS[..2] {
        let found = error(&slow, large, *pair, fourth_root);
        println!("{pair:?}: {found:.1e}");
        assert!(found.abs() < 0.01, "{pair:?}: {found}");
    }
}

#[test]
fn few_cells_are_summed_directly_whatever_the_parameters() {
    let grid = grid(4, 5, 9);
    let cases = [
        parameters(GroundCost::Distance, 0.1, 0.05, 0.8),
        parameters(GroundCost::Distance, 1.0, 0.01, 0.9),
        parameters(GroundCost::SquaredDistance, 1.0, 0.01, 0.8),
    ];
    for parameters in cases {
        assert_eq!(parameters.method(grid).unwrap(), Method::Direct);
        for pair in PAIRS {
            let found = error(&parameters, grid, pair, fourth_root);
            assert!(found.abs() < 1e-6, "{parameters:?} {pair:?}: {found}");
        }
        let (on_study, clusters) = (parameters.method(GraphGrid::STUDY), parameters.accuracy().clusters);
        match parameters.cost() {
            GroundCost::Distance => assert_eq!(on_study, Ok(Method::Clustered { clusters })),
            GroundCost::SquaredDistance => {
                let refused = on_study.unwrap_err();
                assert!(matches!(refused, TransportError::TooManyCells { allowed: 8_000, .. }));
                let message = refused.to_string();
                assert!(message.contains("364500") && message.contains("at most 8000 cells"), "{message}");
            }
        }
    }
}

/// One valid cell a side: the cost of the way between the two points, |x - y|^2/2.
#[test]
fn diracs_are_their_cost_apart() {
    for grid in small_and_large() {
        let mut only = vec![false; grid.len()];
        only[5] = true;
        let prepare = |value: f64| PreparedChannel::new(&study(), grid, &vec![value; grid.len()], Some(&only)).unwrap();
        let h = 0.05 / 8.0;
        for steps in [1, 10, 160, 4000] {
            let shift = f64::from(steps) * h;
            let found = divergence(&study(), &prepare(0.3), &prepare(0.3 + shift)).unwrap();
            assert!((found / (0.5 * shift * shift) - 1.0).abs() < 1e-9, "{grid} {steps}: {found}");
        }
    }
}

/// A shift of everything by c costs c^2/2 once the potentials have converged.
#[test]
fn translations_cost_their_square() {
    let converged = parameters(GroundCost::SquaredDistance, 0.1, 0.05, 0.99);
    for grid in small_and_large() {
        let a = Model::Ggx { a: 0.3, kd: 0.2, f0: 0.1 }.graph(grid, fourth_root);
        for shift in [0.01, 0.1, 1.0] {
            let b: Vec<f64> = a.iter().map(|w| w + shift).collect();
            let found = between(&converged, grid, &a, &b);
            println!("{grid} {shift}: {}", found / (0.5 * shift * shift) - 1.0);
            assert!((found / (0.5 * shift * shift) - 1.0).abs() < 0.01, "{grid} {shift}: {found}");
        }
    }
}

/// The quantile function of the normal distribution, by bisection of its series.
fn normal_quantile(p: f64) -> f64 {
    // erf(x) = 2/sqrt(pi) sum_n x^(2n+1) 2^n e^(-x^2)/(1 3 5 ... (2n+1)).
    let cumulative = |z: f64| {
        let x = z / 2f64.sqrt();
        let (mut term, mut sum) = (x, x);
        for n in 1..200 {
            term *= 2.0 * x * x / f64::from(2 * n + 1);
            sum += term;
        }
        0.5 + sum * (-x * x).exp() / std::f64::consts::PI.sqrt()
    };
    let (mut low, mut high) = (-6.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if cumulative(middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Janati et al., "Entropic optimal transport between unbalanced Gaussian measures has a closed form", NeurIPS 2020,
/// theorem 1 in one dimension, for the cost |x - y|^2/2 and epsilon = sigma^2.
fn gaussian_divergence(a: f64, b: f64, distance: f64, epsilon: f64) -> f64 {
    let transport = |a: f64, b: f64| {
        let d = (4.0 * a * a * b * b + epsilon * epsilon).sqrt();
        0.5 * (a * a + b * b - d + epsilon * (1.0 - (2.0 * epsilon).ln()) + epsilon * (d + epsilon).ln())
    };
    0.5 * distance * distance + transport(a, b) - 0.5 * (transport(a, a) + transport(b, b))
}

#[test]
fn gaussians_follow_their_closed_form() {
    // The base hardly matters at alpha = 0.001: what remains is the value axis.
    let parameters = parameters(GroundCost::SquaredDistance, 0.001, 0.1, 0.99);
    let grid = grid(8, 10, 25);
    let quantiles: Vec<f64> = (0..2000).map(|k| normal_quantile((f64::from(k) + 0.5) / 2000.0)).collect();
    let gaussian = |mean: f64, deviation: f64| quantiles.iter().map(|q| mean + deviation * q).collect::<Vec<_>>();
    for (a, b, distance) in [(0.3, 0.3, 0.2), (0.2, 0.4, 0.0), (0.1, 0.15, 0.5)] {
        let found = between(&parameters, grid, &gaussian(1.0, a), &gaussian(1.0 + distance, b));
        let expected = gaussian_divergence(a, b, distance, 0.01);
        println!("{a} {b} {distance}: {found} {expected}");
        assert!((found / expected - 1.0).abs() < 0.01, "{a} {b} {distance}: {found} {expected}");
    }
}

#[test]
fn relabelled_cells_change_nothing() {
    for (n, n_phi) in [(5, 12), (9, 24)] {
        let grid = grid(n, n, n_phi);
        let (a, b) = (PAIRS[0].0.graph(grid, fourth_root), PAIRS[0].1.graph(grid, fourth_root));
        let expected = between(&study(), grid, &a, &b);
        // theta_i and theta_o exchanged; phi_d backwards; everything backwards.
        let exchanged = |w: &[f64]| -> Vec<f64> {
            (0..w.len()).map(|k| w[(k / n_phi % n * n + k / (n * n_phi)) * n_phi + k % n_phi]).collect()
        };
        let mirrored = |w: &[f64]| w.chunks(n_phi).flat_map(|row| row.iter().rev().copied()).collect::<Vec<_>>();
        let backwards = |w: &[f64]| w.iter().rev().copied().collect::<Vec<_>>();
        for found in [
            between(&study(), grid, &exchanged(&a), &exchanged(&b)),
            between(&study(), grid, &mirrored(&a), &mirrored(&b)),
            between(&study(), grid, &backwards(&a), &backwards(&b)),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-10, "{grid}: {found} {expected}");
        }
    }
}

#[test]
fn equal_is_zero_and_swapped_is_the_same() {
    let distance = parameters(GroundCost::Distance, 0.1, 0.05, 0.8);
    let [small, large] = small_and_large();
    for (parameters, grid) in [(study(), small), (distance, small), (study(), large)] {
        for (a, b) in PAIRS {
            let (a, b) = (a.graph(grid, fourth_root), b.graph(grid, fourth_root));
            assert_eq!(between(&parameters, grid, &a, &a), 0.0);
            let (there, back) = (between(&parameters, grid, &a, &b), between(&parameters, grid, &b, &a));
            // Sums over rows and over columns run in another order: potentials of about 1 differ in the last digit.
            assert!((there - back).abs() <= 1e-12 * there.abs() + 1e-15, "{there} {back}");
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let [_, grid] = small_and_large();
    let (a, b) = (PAIRS[1].0.graph(grid, fourth_root), PAIRS[1].1.graph(grid, fourth_root));
    for parameters in [study(), parameters(GroundCost::Distance, 0.1, 0.05, 0.5)] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| between(&parameters, grid, &a, &b).to_bits())
        };
        assert_eq!(with(1), with(2));
    }
}

#[test]
fn extreme_tables_give_finite_numbers() {
    let grid = grid(4, 4, 10);
    let glossy = PAIRS[1].0.graph(grid, |t| t);
    let mut mirror = vec![0.01; 160];
    mirror[77] = 1e5;
    let tables = [vec![0.0; 160], vec![0.3; 160], vec![1e-300; 160], mirror, glossy];
    for parameters in [
        study(),
        parameters(GroundCost::SquaredDistance, 0.1, 0.01, 0.9),
        parameters(GroundCost::SquaredDistance, 1.0, 0.01, 0.8),
        parameters(GroundCost::Distance, 0.1, 0.05, 0.8),
    ] {
        for a in &tables {
            for b in &tables {
                let found = between(&parameters, grid, a, b);
                let expected = brute_force(&parameters, grid, a, b);
                assert!((found - expected).abs() <= 1e-6 * expected.abs() + 1e-12, "{found} {expected}");
            }
        }
    }
}

/// The same where graphs are quantised: the mirror's peak is 1e5, tones leave it there or at 18.
#[test]
fn extreme_tables_of_many_cells_give_finite_numbers() {
    let [_, grid] = small_and_large();
    let glossy = PAIRS[1].0.graph(grid, |t| t);
    let mut mirror = vec![0.01; grid.len()];
    mirror[77] = 1e5;
    let root: Vec<f64> = mirror.iter().copied().map(fourth_root).collect();
    let tables = [vec![0.0; grid.len()], vec![0.3; grid.len()], vec![1e-300; grid.len()], mirror, root, glossy];
    for parameters in [study(), parameters(GroundCost::SquaredDistance, 0.01, 0.05, 0.9)] {
        for a in &tables {
            for b in &tables {
                let found = between(&parameters, grid, a, b);
                assert!(found.is_finite() && found >= -1e-12, "{found}");
                assert_eq!(found == 0.0, a == b || found.abs() < 1e-300, "{found}");
            }
        }
        // All the mass moves by 0.3, or one cell of N by nearly 1e5.
        let shift = between(&parameters, grid, &tables[0], &tables[1]);
        assert!((shift / 0.045 - 1.0).abs() < 1e-3, "{shift}");
        let peak = between(&parameters, grid, &tables[2], &tables[3]);
        assert!((peak / (0.5 * 1e10 / grid.len() as f64) - 1.0).abs() < 0.3, "{peak}");
    }
}

#[test]
fn cells_that_one_side_lacks_are_left_out_of_both() {
    for grid in small_and_large() {
        let (mut a, mut b) = (PAIRS[0].0.graph(grid, fourth_root), PAIRS[0].1.graph(grid, fourth_root));
        let lacks = |modulus: usize| (0..grid.len()).map(|k| k % modulus != 3).collect::<Vec<_>>();
        let (mask_a, mask_b) = (lacks(7), lacks(5));
        // Whatever stands in a masked cell is ignored.
        (0..grid.len()).filter(|&k| !mask_a[k]).for_each(|k| a[k] = f64::NAN);
        (0..grid.len()).filter(|&k| !mask_b[k]).for_each(|k| b[k] = f64::INFINITY);
        let prepare = |w: &[f64], mask: &[bool]| PreparedChannel::new(&study(), grid, w, Some(mask)).unwrap();
        let (reference, candidate) = (prepare(&a, &mask_a), prepare(&b, &mask_b));
        let found = divergence(&study(), &reference, &candidate).unwrap();
        let both: Vec<bool> = mask_a.iter().zip(&mask_b).map(|(a, b)| *a && *b).collect();
        assert_eq!(found, divergence(&study(), &prepare(&a, &both), &prepare(&b, &both)).unwrap());
        let common = |values: &[f64]| -> Vec<_> {
            let points = pairs::points(grid, 0.1, values).into_iter().zip(&both);
            points.filter(|(_, both)| **both).map(|(x, _)| x).collect()
        };
        let expected = pairs::divergence(2, 0.05, 0.8, &common(&a), &common(&b));
        assert!((found / expected - 1.0).abs() < 0.01, "{grid}: {found} {expected}");

        let (value, gradient) = divergence_and_gradient(&study(), &reference, &candidate).unwrap();
        assert_eq!(value, found);
        assert!(gradient.iter().zip(&both).all(|(g, both)| g.is_finite() && (*g == 0.0 || *both)));

        let none: Vec<bool> = mask_a.iter().map(|valid| !valid).collect();
        let other = prepare(&vec![0.2; grid.len()], &none);
        assert_eq!(divergence(&study(), &other, &reference), Err(TransportError::NoCommonCell));
    }
}

#[test]
fn bad_input_is_named() {
    let grid = grid(4, 4, 10);
    let prepare = |values: &[f64], mask: Option<&[bool]>| PreparedChannel::new(&study(), grid, values, mask);
    let ok = prepare(&[0.1; 160], None).unwrap();
    assert_eq!(prepare(&[0.1; 160], Some(&[false; 160])).unwrap_err(), TransportError::NoValidCell);
    let short = TransportError::Length { what: "values", found: 159, expected: 160 };
    assert_eq!(prepare(&[0.1; 159], None).unwrap_err(), short);
    let mut values = [0.1; 160];
    values[9] = f64::NAN;
    assert!(matches!(prepare(&values, None), Err(TransportError::NotFinite { cell: 9, .. })));
    let [_, large] = small_and_large();
    let huge = PreparedChannel::new(&study(), large, &vec![1e300; large.len()], None);
    assert!(matches!(huge, Err(TransportError::ValueTooLarge { cell: 0, .. })));
    let other = PreparedChannel::new(&study(), large, &vec![0.1; large.len()], None).unwrap();
    assert_eq!(divergence(&study(), &ok, &other), Err(TransportError::Mismatch));
    let finer = parameters(GroundCost::SquaredDistance, 0.1, 0.02, 0.8);
    assert_eq!(divergence(&finer, &other, &other), Err(TransportError::Mismatch));

    let new = |alpha, blur, scaling| SinkhornParameters::new(GroundCost::SquaredDistance, alpha, blur, scaling);
    for (parameters, name) in [
        (new(0.0, 0.05, 0.8), "alpha"),
        (new(0.1, -1.0, 0.8), "blur"),
        (new(0.1, f64::NAN, 0.8), "blur"),
        (new(0.1, 0.05, 1.0), "scaling"),
        (new(0.1, 0.05, 0.0), "scaling"),
    ] {
        let message = parameters.unwrap_err().to_string();
        assert!(message.starts_with(name), "{message}");
    }
    let standard = study().accuracy();
    for none in [Accuracy { values_per_blur: 0, ..standard }, Accuracy { clusters: 0, ..standard }] {
        assert!(matches!(study().with_accuracy(none), Err(TransportError::Parameter { .. })));
    }
}

/// Against differences of the divergence itself. The extreme values stay, and with them the epsilons.
#[test]
fn gradient_agrees_with_finite_differences() {
    let mut seed = 1u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let [small, large] = small_and_large();
    let distance = parameters(GroundCost::Distance, 0.1, 0.05, 0.8);
    let slow = parameters(GroundCost::SquaredDistance, 0.1, 0.05, 0.95);
    // Where graphs are quantised, the derivative jumps where a value passes a node: the last digits of the differences.
    for (parameters, grid, tolerance) in
        [(study(), small, 1e-6), (distance, small, 1e-5), (study(), large, 1e-3), (slow, large, 1e-3)]
    {
        for (a, b) in PAIRS {
            let (a, b) = (a.graph(grid, fourth_root), b.graph(grid, fourth_root));
            let prepare = |values: &[f64]| PreparedChannel::new(&parameters, grid, values, None).unwrap();
            let reference = prepare(&a);
            let (value, gradient) = divergence_and_gradient(&parameters, &reference, &prepare(&b)).unwrap();
            assert_eq!(value, divergence(&parameters, &reference, &prepare(&b)).unwrap());
            // Mirror images of a cell differ in the last digit: none of them may overtake.
            let extreme = |w: f64| b.iter().all(|x| *x <= w + 1e-5) || b.iter().all(|x| *x >= w - 1e-5);
            // A distance has a kink where points of the two sides meet.
            let meet = |v: f64, w: f64| parameters.cost() == GroundCost::Distance && (v - w).abs() < 1e-5;
            let of_cell = |(&v, &w)| if extreme(w) || meet(v, w) { 0.0 } else { random() };
            let direction: Vec<f64> = a.iter().zip(&b).map(of_cell).collect();
            let moved = |step: f64| {
                let b: Vec<f64> = b.iter().zip(&direction).map(|(w, d)| w + step * d).collect();
                divergence(&parameters, &reference, &prepare(&b)).unwrap()
            };
            let step = 1e-6;
            let expected = (moved(step) - moved(-step)) / (2.0 * step);
            let found: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
            let scale = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
            println!("{grid} {found:e} {expected:e} {scale:e}");
            assert!((found - expected).abs() < tolerance * scale + 1e-10, "{grid} {found:e} {expected:e} {scale:e}");
        }
    }
}

/// Along a parameter of the candidate's model, so that cells cluster in the same way on both sides of the step.
#[test]
fn gradient_of_clusters_agrees_with_finite_differences() {
    let (small, large) = (grid(10, 9, 32), grid(12, 12, 32));
    let distance = GroundCost::Distance;
    for (grid, cost, clusters) in [
        (small, distance, 900),
        (small, distance, 300),
        (small, GroundCost::SquaredDistance, 300),
        // So many that the divergence is what it settles to.
        (large, distance, 2500),
    ] {
        // So long a base that squares are clustered as well.
        let alpha = if cost == GroundCost::Distance { 0.1 } else { 1.01 };
        let parameters = parameters(cost, alpha, 0.05, 0.8);
        let parameters = parameters.with_accuracy(Accuracy { clusters, ..parameters.accuracy() }).unwrap();
        assert_eq!(parameters.method(grid).unwrap(), Method::Clustered { clusters });
        let prepare = |values: &[f64]| PreparedChannel::new(&parameters, grid, values, None).unwrap();
        let candidate = |x: f64| Model::Ggx { a: 0.2 + x, kd: 0.2 - 0.3 * x, f0: 0.1 + x }.graph(grid, fourth_root);
        let reference = prepare(&PAIRS[1].1.graph(grid, fourth_root));
        let (value, gradient) = divergence_and_gradient(&parameters, &reference, &prepare(&candidate(0.0))).unwrap();
        assert_eq!(value, divergence(&parameters, &reference, &prepare(&candidate(0.0))).unwrap());
        let step = 1e-5;
        let at = |x: f64| divergence(&parameters, &reference, &prepare(&candidate(x))).unwrap();
        let expected = (at(step) - at(-step)) / (2.0 * step);
        let slopes = candidate(step).into_iter().zip(candidate(-step)).map(|(y, x)| (y - x) / (2.0 * step));
        let found: f64 = gradient.iter().zip(slopes).map(|(g, slope)| g * slope).sum();
        assert!((found / expected - 1.0).abs() < 1e-4, "{cost:?} {clusters}: {found} {expected}");
    }
}

#[test]
fn a_step_against_the_gradient_reduces_the_divergence() {
    for grid in small_and_large() {
        let (a, b) = (PAIRS[0].0.graph(grid, fourth_root), PAIRS[0].1.graph(grid, fourth_root));
        let prepare = |values: &[f64]| PreparedChannel::new(&study(), grid, values, None).unwrap();
        let reference = prepare(&a);
        let (value, gradient) = divergence_and_gradient(&study(), &reference, &prepare(&b)).unwrap();
        let square: f64 = gradient.iter().map(|g| g * g).sum();
        let step = 0.1 * value / square;
        let nearer: Vec<f64> = b.iter().zip(&gradient).map(|(w, g)| w - step * g).collect();
        let reduced = divergence(&study(), &reference, &prepare(&nearer)).unwrap();
        assert!((0.8 * value..0.95 * value).contains(&reduced), "{grid}: {value:e} {reduced:e}");
    }
}
