use super::*;
use rand::Rng;
use vernis_metric::math::seed;

/// Unbalanced rows by formula, with effects of every factor and of type x method.
struct Rows {
    response: Vec<f64>,
    kind: Vec<&'static str>,
    method: Vec<&'static str>,
    light: Vec<&'static str>,
}

fn rows() -> Rows {
    let mut rows = Rows { response: vec![], kind: vec![], method: vec![], light: vec![] };
    for i in 0..90usize {
        let metal = i % 10 < 3;
        let method = (i * i + i / 7) % 4;
        let grace = (i * 3 + i / 5) % 8 < 5;
        let effect = |yes: bool, size: f64| if yes { size } else { 0.0 };
        rows.response.push(
            3.0 + 0.4 * (i as f64 * 1.3).sin() + effect(metal, 0.3) + 0.2 * method as f64
                - effect(metal && method == 2, 0.5)
                + effect(grace && metal, 0.1),
        );
        rows.kind.push(if metal { "metal" } else { "dielectric" });
        rows.method.push(["A", "B", "C", "D"][method]);
        rows.light.push(if grace { "grace" } else { "uffizi" });
    }
    rows
}

fn check(anova: &Anova, factors: &[&str], sum: f64, freedom: usize, f: f64, p: f64) {
    let term = anova.term(factors).unwrap();
    assert_eq!(term.freedom, freedom, "{factors:?}");
    for (found, expected) in [(term.sum_of_squares, sum), (term.f, f), (term.p, p)] {
        assert!((found / expected - 1.0).abs() < 1e-6, "{factors:?}: {found} {expected}");
    }
}

#[test]
fn two_and_three_ways_agree_with_statsmodels() {
    // statsmodels 0.15.0, the rows of `rows` as a data frame d with the columns y, type, method, light:
    //   anova_lm(ols("y ~ C(type,Sum)*C(method,Sum)", d).fit(), typ=2)
    //   anova_lm(ols("y ~ C(type,Sum)*C(method,Sum)*C(light,Sum)", d).fit(), typ=2)
    // Cells have 6 to 18 and 1 to 16 rows; typ=3 differs from typ=2 in the first digits.
    let rows = rows();
    let factor = |name: &'static str, levels: &Vec<&'static str>| Factor { name, levels: levels.clone() };
    let (kind, method, light) =
        (factor("type", &rows.kind), factor("method", &rows.method), factor("light", &rows.light));
    let two = anova(&rows.response, &[kind.clone(), method.clone()]).unwrap();
    check(&two, &["type"], 1.18902216059017, 1, 13.69289415549379, 0.00038847009934);
    check(&two, &["method"], 3.62369322060681, 3, 13.91026715518946, 0.00000020482495);
    check(&two, &["type", "method"], 1.09733362415781, 3, 4.21233336851051, 0.00801308666580);
    assert_eq!((two.residual_freedom, two.cells, two.empty_cells), (82, 8, 0));
    assert!((two.residual_sum_of_squares - 7.12046818307402).abs() < 1e-12);

    let three = anova(&rows.response, &[kind, method, light]).unwrap();
    check(&three, &["type"], 1.69207669710181, 1, 21.30885217415779, 0.00001609813913);
    check(&three, &["method"], 4.01499243701799, 3, 16.85401937696168, 0.00000001930080);
    check(&three, &["light"], 1.04392285019606, 1, 13.14644763689151, 0.00052619343111);
    check(&three, &["type", "method"], 0.86722661427608, 3, 3.64041885271439, 0.01652258436330);
    check(&three, &["light", "type"], 0.04679025473573, 1, 0.58924434280226, 0.44515395573177);
    check(&three, &["method", "light"], 0.03361290134856, 3, 0.14109926719198, 0.93504649281493);
    check(&three, &["type", "method", "light"], 0.11850478329561, 3, 0.49745595919734, 0.68517459887845);
    assert_eq!(three.residual_freedom, 74);
    assert_eq!(three.terms.iter().map(|t| t.factors.len()).collect::<Vec<_>>(), [1, 1, 1, 2, 2, 2, 3]);
}

#[test]
fn interactions_are_found_where_they_are_and_nowhere_else() {
    let mut rng = seed::stream(1, "anova", 0);
    let kind: Vec<&str> = (0..120).map(|i| if i % 3 == 0 { "metal" } else { "dielectric" }).collect();
    let method: Vec<&str> = (0..120).map(|i| ["A", "B", "C", "D"][(i / 3) % 4]).collect();
    let factors = [Factor { name: "type", levels: kind.clone() }, Factor { name: "method", levels: method.clone() }];
    let mut found = |interaction: f64| {
        let runs = (0..300).filter(|_| {
            let row = |i: usize| {
                let both = kind[i] == "metal" && method[i] == "B";
                let main = if method[i] == "C" { 0.5 } else { 0.0 };
                rng.random_range(-1.0..1.0) + main + if both { interaction } else { 0.0 }
            };
            let response: Vec<f64> = (0..120).map(row).collect();
            anova(&response, &factors).unwrap().term(&["type", "method"]).unwrap().p < 0.05
        });
        runs.count()
    };
    let (none, strong) = (found(0.0), found(1.2));
    // Binomial(300, 0.05): 6 to 25 with probability > 0.99.
    assert!((6..=25).contains(&none), "{none}");
    assert!(strong > 280, "{strong}");
}

#[test]
fn empty_cells_cost_degrees_of_freedom() {
    let rows = rows();
    let keep: Vec<usize> = (0..90).filter(|&i| !(rows.kind[i] == "metal" && rows.method[i] == "A")).collect();
    let pick = |levels: &[&'static str]| keep.iter().map(|&i| levels[i]).collect::<Vec<_>>();
    let response: Vec<f64> = keep.iter().map(|&i| rows.response[i]).collect();
    let factors =
        [Factor { name: "type", levels: pick(&rows.kind) }, Factor { name: "method", levels: pick(&rows.method) }];
    let table = anova(&response, &factors).unwrap();
    assert_eq!((table.empty_cells, table.term(&["type", "method"]).unwrap().freedom), (1, 2));
}

#[test]
fn designs_that_say_nothing_are_refused() {
    let rows = rows();
    let same = Factor { name: "light", levels: vec!["grace"; 90] };
    assert!(matches!(anova(&rows.response, &[same]), Err(StudyError::OneLevel { found: 1, .. })));
    let row: Vec<String> = (0..90).map(|i| i.to_string()).collect();
    let each = Factor { name: "row", levels: row.iter().map(String::as_str).collect() };
    assert!(matches!(anova(&rows.response, &[each]), Err(StudyError::Saturated { rows: 90, parameters: 90 })));
    let (a, b) = (Factor { name: "a", levels: rows.kind.clone() }, Factor { name: "b", levels: rows.kind.clone() });
    assert!(matches!(anova(&rows.response, &[a, b]), Err(StudyError::Confounded { .. })));
    let kind = Factor { name: "type", levels: rows.kind };
    assert!(matches!(anova(&[3.0; 90], &[kind]), Err(StudyError::NoSpread { .. })));
}
