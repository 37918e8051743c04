//! Text for messages: names that are nearly right, foreign text on one line, and counts.

/// How similar two names must be for one to be suggested, 0 to 1.
const SIMILAR: f64 = 0.5;
/// Names suggested at most.
const LISTED: usize = 3;
/// A shorter part of a name says little.
const SHORTEST_PART: usize = 3;

/// The entries of `known` most similar to `found`, best first: at most three, none that has little in common with it. Case
/// does not count; a name that contains `found` is similar (`gold` in `gold-paint`).
pub fn nearest<S: AsRef<str>>(found: &str, known: impl IntoIterator<Item = S>) -> Vec<String> {
    let found = found.to_lowercase();
    let mut ranked: Vec<(f64, String)> = known
        .into_iter()
        .map(|name| (similarity(&found, &name.as_ref().to_lowercase()), name.as_ref().to_owned()))
        .filter(|(similarity, _)| *similarity >= SIMILAR)
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    ranked.dedup_by(|a, b| a.1 == b.1);
    ranked.into_iter().take(LISTED).map(|(_, name)| name).collect()
}

fn similarity(found: &str, name: &str) -> f64 {
    let edits = strsim::normalized_damerau_levenshtein(found, name);
    let part = found.chars().count() >= SHORTEST_PART && name.contains(found);
    if part { edits.max(SIMILAR) } else { edits }
}

/// `did you mean a, b?`, or that no name is similar.
pub fn did_you_mean(nearest: &[String]) -> String {
    if nearest.is_empty() { "no name is similar".to_owned() } else { format!("did you mean {}?", nearest.join(", ")) }
}

/// Text of a file or of a user as a message may show it: one line of at most `most` characters, and how many there are
/// where that is less than all.
pub fn shown(text: &str, most: usize) -> String {
    let mut line = String::new();
    for (k, c) in text.chars().enumerate() {
        if k == most {
            return format!("{line}... ({} characters)", text.chars().count());
        }
        if c.is_control() { line.extend(c.escape_debug()) } else { line.push(c) }
    }
    line
}

/// A number as short as reads back the same, with an exponent where it would be a long row of zeros: 0.15, 1e-300.
pub fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

/// A number with `places` decimals, or as many digits with an exponent where these would show nothing or a long row of digits.
pub fn decimals(x: f64, places: usize) -> String {
    let shows = x == 0.0 || !x.is_finite() || (10f64.powi(2 - places as i32)..1e9).contains(&x.abs());
    if shows { format!("{x:.places$}") } else { format!("{x:.0$e}", places.saturating_sub(1)) }
}

/// A number and what it counts: `1 method`, `2 methods`, `3 families`, `4 stimuli`. `one` is the word for one of them.
pub fn counted(n: usize, one: &str) -> String {
    let stem = one.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'i', 'o', 'u']));
    match (n, stem, one.strip_suffix("us")) {
        (1, _, _) => format!("1 {one}"),
        (_, Some(stem), _) => format!("{n} {stem}ies"),
        (_, _, Some(stem)) => format!("{n} {stem}i"),
        _ if one.ends_with('s') => format!("{n} {one}es"),
        _ => format!("{n} {one}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extreme_numbers_are_short() {
        for (x, expected) in [
            (0.15, "0.15"),
            (-2.0, "-2"),
            (0.0, "0"),
            (1e-300, "1e-300"),
            (1.5e300, "1.5e300"),
            (0.0001, "0.0001"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(x), expected);
        }
        for (x, places, expected) in [
            (0.25, 4, "0.2500"),
            (0.0, 6, "0.000000"),
            (1234.5, 4, "1234.5000"),
            (1e-300, 4, "1.000e-300"),
            (2e26, 6, "2.00000e26"),
            (0.00051, 6, "0.000510"),
        ] {
            assert_eq!(decimals(x, places), expected);
        }
    }

    #[test]
    fn one_is_singular() {
        for (n, one, expected) in [
            (0, "method", "0 methods"),
            (1, "method", "1 method"),
            (2, "method", "2 methods"),
            (1, "family", "1 family"),
            (3, "family", "3 families"),
            (2, "day", "2 days"),
            (2, "loss", "2 losses"),
            (1, "stimulus", "1 stimulus"),
            (4, "stimulus", "4 stimuli"),
        ] {
            assert_eq!(counted(n, one), expected);
        }
    }

    #[test]
    fn similar_names_are_suggested_and_others_are_not() {
        let models = ["lambert", "ward", "ward-duer", "ggx", "ggx-dielectric", "rational-chebyshev", "beckmann"];
        assert_eq!(nearest("Wrad", models), ["ward"]);
        assert_eq!(nearest("ggx-dielectrc", models), ["ggx-dielectric"]);
        assert_eq!(nearest("beckman", models), ["beckmann"]);
        assert_eq!(nearest("chebyshev", models), ["rational-chebyshev"]);
        assert!(nearest("disney", models).is_empty());
        assert!(nearest("", models).is_empty());
        assert_eq!(nearest("gold", ["gold-paint", "gold-metallic-paint2", "aluminium"]).len(), 2);
    }

    #[test]
    fn foreign_text_stays_on_one_line() {
        assert_eq!(shown("a\nb\u{1b}[31m", 20), "a\\nb\\u{1b}[31m");
        assert_eq!(shown("abcdef", 3), "abc... (6 characters)");
    }
}
