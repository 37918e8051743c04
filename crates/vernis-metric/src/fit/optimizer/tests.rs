use super::*;

/// A function with its gradient, over a box.
struct Function {
    bounds: Vec<(f64, f64)>,
    value: fn(&[f64]) -> f64,
    gradient: fn(&[f64]) -> Vec<f64>,
}

impl Objective for Function {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn value(&self, x: &[f64]) -> Result<f64, FitError> {
        assert!(x.iter().zip(&self.bounds).all(|(x, (low, high))| (low..=high).contains(&x)), "{x:?} is outside");
        Ok((self.value)(x))
    }

    fn gradient(&self, x: &[f64]) -> Result<(f64, Vec<f64>), FitError> {
        Ok((self.value(x)?, (self.gradient)(x)))
    }
}

/// Rosenbrock 1960, doi:10.1093/comjnl/3.3.175: minimum 0 at (1, 1), at the end of a curved valley.
fn rosenbrock(bounds: [(f64, f64); 2]) -> Function {
    Function {
        bounds: bounds.to_vec(),
        value: |x| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2),
        gradient: |x| {
            let d = x[1] - x[0] * x[0];
            vec![-400.0 * d * x[0] - 2.0 * (1.0 - x[0]), 200.0 * d]
        },
    }
}

/// sum k (x_k - k/4)^2, k = 1..6.
fn bowl(bounds: (f64, f64)) -> Function {
    Function {
        bounds: vec![bounds; 6],
        value: |x| x.iter().zip(1..).map(|(x, k)| f64::from(k) * (x - 0.25 * f64::from(k)).powi(2)).sum(),
        gradient: |x| x.iter().zip(1..).map(|(x, k)| 2.0 * f64::from(k) * (x - 0.25 * f64::from(k))).collect(),
    }
}

const LIMITS: Limits = Limits { max_evaluations: 20_000, step: 0.5, tolerance: 1e-7, gain: 1e-10, patience: None };

fn run(method: Method, function: &Function, start: &[f64]) -> Outcome {
    minimise(method, function, start, LIMITS, &unwatched).expect("finite")
}

/// 30 |x_2 - x_1^2| + (1 - x_1)^2: minimum 0 at (1, 1), at the end of a curved edge. A line search that asks for a decrease alone
/// stops where the edge begins, at 4.
fn edge() -> Function {
    Function {
        bounds: vec![(-5.0, 5.0); 2],
        value: |x| 30.0 * (x[1] - x[0] * x[0]).abs() + (1.0 - x[0]).powi(2),
        gradient: |x| {
            let side = 30.0 * (x[1] - x[0] * x[0]).signum();
            vec![-2.0 * side * x[0] - 2.0 * (1.0 - x[0]), side]
        },
    }
}

#[test]
fn lbfgs_follows_an_edge() {
    let found = run(Method::Lbfgs, &edge(), &[-1.2, 1.0]);
    assert!(found.value < 1e-3, "{found:?}");
}

#[test]
fn a_search_without_prospects_is_given_up() {
    let with = |patience: Option<Patience>| {
        let limits = Limits { patience, ..LIMITS };
        minimise(Method::Lbfgs, &edge(), &[-1.2, 1.0], limits, &unwatched).expect("finite")
    };
    let patience = Patience { evaluations: 20, share: 0.01, beat: f64::INFINITY };
    let (whole, short) = (with(None), with(Some(patience)));
    assert_eq!(short.stop, StopReason::Converged);
    assert!(short.evaluations < whole.evaluations && short.value >= whole.value, "{short:?} {whole:?}");
    let a_round_ago =
        short.history.iter().rev().find(|step| step.evaluations + 20 <= short.evaluations).expect("longer");
    assert!(a_round_ago.value - short.value <= 0.01 * (short.history[0].value - short.value), "{short:?}");
    // The function is nowhere below 0: after the start and one and a half rounds there is nothing to hope for.
    let beaten = with(Some(Patience { beat: -100.0, share: 0.0, ..patience }));
    assert_eq!((beaten.stop, beaten.evaluations), (StopReason::Converged, 31));
}

#[test]
fn every_method_reaches_the_end_of_the_valley() {
    let function = rosenbrock([(-5.0, 5.0); 2]);
    for method in Method::ALL {
        let found = run(method, &function, &[-1.2, 1.0]);
        assert!(found.stop.is_success(), "{method}: {:?}", found.stop);
        assert!(found.x.iter().all(|x| (x - 1.0).abs() < 1e-4), "{method}: {:?}", found.x);
        assert!(found.history.windows(2).all(|w| w[1].value < w[0].value && w[1].evaluations > w[0].evaluations));
        assert_eq!(found.history.last().map(|h| h.value), Some(found.value));
    }
}

/// With x_0 <= 0.5 the minimum of Rosenbrock's function lies at the bound, at (0.5, 0.25), with the value 0.25.
#[test]
fn a_minimum_at_a_bound_is_found() {
    let function = rosenbrock([(-5.0, 0.5), (-5.0, 5.0)]);
    for method in Method::ALL {
        let found = run(method, &function, &[-1.2, 1.0]);
        assert!((found.x[0] - 0.5).abs() < 1e-4 && (found.x[1] - 0.25).abs() < 1e-3, "{method}: {:?}", found.x);
        assert!((found.value - 0.25).abs() < 1e-6, "{method}: {}", found.value);
    }
    // Every second variable is held: the minimum is the nearest point of the box.
    let function = bowl((0.6, 1.1));
    for method in Method::ALL {
        let found = run(method, &function, &[0.8; 6]);
        for (k, x) in (1..).zip(&found.x) {
            assert!((x - (0.25 * f64::from(k)).clamp(0.6, 1.1)).abs() < 1e-4, "{method}: {:?}", found.x);
        }
    }
}

#[test]
fn the_best_point_is_kept_when_the_evaluations_are_spent() {
    let function = rosenbrock([(-5.0, 5.0); 2]);
    for method in Method::ALL {
        let limits = Limits { max_evaluations: 12, ..LIMITS };
        let found = minimise(method, &function, &[-1.2, 1.0], limits, &unwatched).expect("finite");
        assert_eq!((found.stop, found.evaluations), (StopReason::EvaluationLimit, 12), "{method}");
        assert!(found.value < 24.2 && found.value == (function.value)(&found.x), "{method}");
    }
}

/// A function that does not depend on its variables, to a millionth, has no minimum to converge to; one with a minimum at the start
/// has.
#[test]
fn a_flat_function_is_told_from_a_minimum() {
    let mut function = bowl((-5.0, 5.0));
    let minimum: Vec<f64> = (1..=6).map(|k| 0.25 * f64::from(k)).collect();
    for (flat, value) in [
        (true, (|_| 3.0) as fn(&[f64]) -> f64),
        (true, |x| 2e26 + x[0] * x[0]),
        (false, |x| 1.0 + x.iter().zip(1..).map(|(x, k)| (x - 0.25 * f64::from(k)).powi(2)).sum::<f64>()),
        (false, |x| x[5].abs() * 1e-3 + 7.0),
        (false, |_| 0.0),
    ] {
        function.value = value;
        function.gradient = |x| {
            let value =
                |x: &[f64]| 1.0 + x.iter().zip(1..).map(|(x, k)| (x - 0.25 * f64::from(k)).powi(2)).sum::<f64>();
            let moved = |k: usize, h: f64| {
                value(&x.iter().enumerate().map(|(i, x)| x + if i == k { h } else { 0.0 }).collect::<Vec<_>>())
            };
            let slope = |k: usize| (moved(k, 1e-6) - moved(k, -1e-6)) / 2e-6;
            (0..x.len()).map(|k| 1e-3 * slope(k)).collect()
        };
        for method in Method::ALL {
            let found = run(method, &function, &minimum);
            assert_eq!(found.stop == StopReason::Flat, flat, "{method}: {:?} {}", found.stop, found.value);
        }
    }
}

#[test]
fn a_search_that_is_interrupted_keeps_its_best_and_makes_one_evaluation_at_least() {
    let function = rosenbrock([(-5.0, 5.0); 2]);
    for method in Method::ALL {
        for (allowed, expected) in [(0, 1), (1, 1), (9, 9)] {
            let watched = |n: usize| if n > allowed { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            let found = minimise(method, &function, &[-1.2, 1.0], LIMITS, &watched).expect("finite");
            assert_eq!((found.stop, found.evaluations), (StopReason::Interrupted, expected), "{method}");
            assert!(found.value <= 24.21 && found.value == (function.value)(&found.x), "{method}");
        }
    }
}

#[test]
fn a_start_without_a_value_is_refused_and_a_start_outside_is_moved() {
    let mut function = bowl((0.0, 2.0));
    let found = run(Method::NelderMead, &function, &[9.0; 6]);
    assert!(found.value < 1e-6);
    // The origin, where an optimiser's memory begins, is outside.
    function.bounds = vec![(0.5, 2.0); 6];
    function.value = |_| f64::NAN;
    for method in Method::ALL {
        let error = minimise(method, &function, &[1.0; 6], LIMITS, &unwatched).expect_err("no value anywhere");
        assert!(error.to_string().contains("no finite value"), "{error}");
    }
}
