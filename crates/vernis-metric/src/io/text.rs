//! Text for messages: names that are nearly right, foreign text that a terminal may show, numbers and counts.

use std::borrow::Cow;

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
    match text.char_indices().nth(most) {
        None => one_line(text).into_owned(),
        Some((end, _)) => format!("{}... ({} characters)", one_line(&text[..end]), text.chars().count()),
    }
}

/// Whether a character would do something to a terminal, or to the order in which text is shown, instead of being shown:
/// controls (C0, DEL, C1), line and paragraph separators, marks, overrides and isolates of direction, and tags.
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
        || matches!(c, '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// Text as a terminal may show it: what would act on the terminal (escape sequences of
/// ECMA-48, directions of writing) is written as JSON writes it, such as `\u001b`. Line breaks and tabs stay.
///
/// JSON stays the same JSON: in it, such characters occur only inside strings.
pub fn for_terminal(text: &str) -> Cow<'_, str> {
    escaped(text, |c| acts(c) && c != '\n' && c != '\t')
}

/// [`for_terminal`] on one line: line breaks and tabs are written as `\n` and `\t`.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, acts)
}

fn escaped(text: &str, which: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&which) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if !which(c) => shown.push(c),
            '\n' => shown.push_str("\\n"),
            '\r' => shown.push_str("\\r"),
            '\t' => shown.push_str("\\t"),
            c => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| shown += &format!("\\u{unit:04x}")),
        }
    }
    Cow::Owned(shown)
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
        assert_eq!(shown("a\nb\u{1b}[31m", 20), "a\\nb\\u001b[31m");
        assert_eq!(shown("abcdef", 3), "abc... (6 characters)");
    }

    #[test]
    fn nothing_acts_on_the_terminal() {
        assert_eq!(for_terminal("two\n\tlines"), "two\n\tlines");
        assert_eq!(for_terminal("\u{1b}]0;title\u{7}\r"), "\\u001b]0;title\\u0007\\r");
        // C1 begins sequences as ESC does; overrides of direction show a name as another.
        assert_eq!(for_terminal("\u{9b}31m\u{7f}"), "\\u009b31m\\u007f");
        assert_eq!(for_terminal("a\u{202e}gnp.exe\u{2066}"), "a\\u202egnp.exe\\u2066");
        assert_eq!(for_terminal("\u{e0041}"), "\\udb40\\udc41");
        assert_eq!(one_line("a\tb\r\nc"), "a\\tb\\r\\nc");
        let name = "Lavou\u{e9} \u{3b1} \u{6c49}";
        assert!(matches!(for_terminal(name), Cow::Borrowed(same) if same == name));
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({"na\u{9b}me": "a\u{202e}\u{e0041}\u{1b}\u{7f}\"\\"});
        let text = serde_json::to_string_pretty(&value).unwrap();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&for_terminal(&text)).unwrap(), value);
    }
}
