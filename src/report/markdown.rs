//! Foreign text in Markdown: names of studies, materials and metrics, captions, commands.
//!
//! What a file or an argument says appears as that text: it opens no tag, no link, no code and no further cell of a table.

use vernis_metric::io::one_line;

/// Text in a paragraph, a heading, an item or a cell of a table.
pub fn text(words: &str) -> String {
    let words = one_line(words);
    let mut page = String::with_capacity(words.len());
    let mut last = ' ';
    for c in words.chars() {
        match c {
            '&' => page.push_str("&amp;"),
            '<' => page.push_str("&lt;"),
            // Intervals in brackets are everywhere; only brackets before a parenthesis or a colon make a link.
            '(' | ':' if last == ']' => page.extend(['\\', c]),
            '\\' | '`' | '|' => page.extend(['\\', c]),
            c => page.push(c),
        }
        last = c;
    }
    page
}

/// Text as code: in as many backticks as it needs.
pub fn code(words: &str) -> String {
    let words = one_line(words);
    let runs = words.split(|c| c != '`').map(str::len);
    let fence = "`".repeat(runs.max().unwrap_or(0) + 1);
    // A blank keeps a backtick at either end apart from the fence.
    let blank = if words.starts_with('`') || words.ends_with('`') || words.is_empty() { " " } else { "" };
    format!("{fence}{blank}{words}{blank}{fence}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        assert_eq!(text("<img src=x onerror=alert(1)>"), "&lt;img src=x onerror=alert(1)>");
        assert_eq!(text("a|b\nc `d` \\"), "a\\|b\\\\nc \\`d\\` \\\\");
        assert_eq!(text("[a](javascript:b) ![c](d) [e]: f"), "[a]\\(javascript:b) ![c]\\(d) [e]\\: f");
        assert_eq!(text("AT&T \u{1b}[31m"), "AT&amp;T \\\\u001b[31m");
        // Names and numbers of our own are as they were.
        for plain in ["D4.Cl.CR", "GPLVM_APPROX.1", "0.899 [0.871, 0.920]", "vernis *better*", "p > 0.05"] {
            assert_eq!(text(plain), plain);
        }
    }

    #[test]
    fn code_ends_where_it_should() {
        assert_eq!(code("vernis train"), "`vernis train`");
        assert_eq!(code("a`b``c"), "```a`b``c```");
        assert_eq!(code("`<b>`"), "`` `<b>` ``");
        assert_eq!(code("a\n# b"), "`a\\n# b`");
    }
}
