//! Members of a family of metrics by their options: `energy[phi=log:eta=0.01,alpha=0.05]`.

use super::{GraphGrid, Tone};
use crate::io::{did_you_mean, nearest};
use crate::metric::MetricError;

/// The options of a name, taken one by one; what is left at the end was a mistake.
#[derive(Debug)]
pub struct Options<'a> {
    name: &'a str,
    pairs: Vec<(&'a str, &'a str)>,
}

impl<'a> Options<'a> {
    /// Splits `family[key=value,...]` into the family and its options; `family` alone has none.
    ///
    /// # Errors
    /// [`MetricError::Parameter`] for an unclosed bracket, an option without `=`, or an option given twice.
    pub fn split(name: &'a str) -> Result<(&'a str, Self), MetricError> {
        let Some((family, rest)) = name.split_once('[') else {
            return Ok((name, Self { name, pairs: Vec::new() }));
        };
        let wrong = |what: String, found: &str, allowed: &str| MetricError::Parameter {
            what,
            found: found.to_owned(),
            allowed: allowed.to_owned(),
        };
        let inner = rest
            .strip_suffix(']')
            .ok_or_else(|| wrong(name.to_owned(), "without its closing bracket", "written NAME[KEY=VALUE,...]"))?;
        let mut pairs: Vec<(&str, &str)> = Vec::new();
        for part in inner.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| wrong(format!("{name}: an option"), &format!("`{part}`"), "KEY=VALUE"))?;
            let (key, value) = (key.trim(), value.trim());
            if pairs.iter().any(|(known, _)| *known == key) {
                return Err(wrong(format!("{name}: `{key}`"), "given twice", "given once"));
            }
            pairs.push((key, value));
        }
        Ok((family, Self { name, pairs }))
    }

    /// The text of an option, if it is given.
    pub fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.pairs.iter().position(|(known, _)| *known == key)?;
        Some(self.pairs.remove(at).1)
    }

    /// The number of an option, if it is given; `check` says which are allowed, in the words of `allowed`.
    pub fn number(
        &mut self,
        key: &str,
        check: impl Fn(f64) -> bool,
        allowed: &str,
    ) -> Result<Option<f64>, MetricError> {
        let Some(text) = self.take(key) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(value) if check(value) => Ok(Some(value)),
            _ => Err(MetricError::Parameter {
                what: format!("{}: {key}", self.name),
                found: if text.is_empty() { "empty".to_owned() } else { text.to_owned() },
                allowed: allowed.to_owned(),
            }),
        }
    }

    /// phi and eta: `phi=t^1/4`, `phi=log:eta=0.01`, or `phi=log,eta=0.01`.
    pub fn tone(&mut self) -> Result<Option<Tone>, MetricError> {
        let eta = self.number("eta", |eta| eta > 0.0 && eta.is_finite(), "a number greater than 0")?;
        match (self.take("phi"), eta) {
            (Some(phi), eta) => Tone::parse(phi, eta).map(Some),
            (None, Some(eta)) => Tone::log(eta).map(Some),
            (None, None) => Ok(None),
        }
    }

    /// The power of the sum of the channels.
    pub fn gamma(&mut self) -> Result<Option<f64>, MetricError> {
        self.number(
            "gamma",
            |gamma| gamma > 0.0 && gamma <= 4.0,
            "greater than 0 and at most 4 (the study uses 0.25, 0.35, 0.5)",
        )
    }

    /// The cells that are compared.
    pub fn grid(&mut self) -> Result<Option<GraphGrid>, MetricError> {
        self.take("grid").map(str::parse).transpose()
    }

    /// Refuses options that nobody took; `known` are the family's, for the message.
    pub fn finish(self, known: &[&str]) -> Result<(), MetricError> {
        let Some((key, _)) = self.pairs.first() else { return Ok(()) };
        let similar = nearest(key, known);
        let hint = if similar.is_empty() { String::new() } else { format!(" ({})", did_you_mean(&similar)) };
        Err(MetricError::Parameter {
            what: format!("{}: an option", self.name),
            found: format!("`{key}`{hint}"),
            allowed: format!("one of {}", known.join(", ")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_taken_apart() {
        let (family, mut options) = Options::split("energy[ phi=log:eta=.01 , alpha=.05,]").unwrap();
        assert_eq!(family, "energy");
        assert_eq!(options.take("phi"), Some("log:eta=.01"));
        assert_eq!(options.number("alpha", |a| a > 0.0, "above 0"), Ok(Some(0.05)));
        assert_eq!(options.number("gamma", |a| a > 0.0, "above 0"), Ok(None));
        assert!(options.finish(&[]).is_ok());
        assert_eq!(Options::split("ot").unwrap().0, "ot");
    }

    #[test]
    fn mistakes_are_named() {
        let refused = |name| {
            let (_, mut options) = match Options::split(name) {
                Ok(parts) => parts,
                Err(error) => return error.to_string(),
            };
            match options.number("alpha", |a| a > 0.0, "a number greater than 0") {
                Ok(_) => options.finish(&["alpha", "gamma", "phi"]).unwrap_err().to_string(),
                Err(error) => error.to_string(),
            }
        };
        assert_eq!(refused("ot[alpha=0]"), "ot[alpha=0]: alpha is 0; it must be a number greater than 0");
        assert_eq!(refused("ot[alpha=x]"), "ot[alpha=x]: alpha is x; it must be a number greater than 0");
        assert_eq!(refused("ot[alpha=]"), "ot[alpha=]: alpha is empty; it must be a number greater than 0");
        assert_eq!(
            refused("ot[alpha=1"),
            "ot[alpha=1 is without its closing bracket; it must be written NAME[KEY=VALUE,...]"
        );
        assert!(refused("ot[alpha=1,alpha=2]").contains("`alpha` is given twice; it must be given once"));
        assert!(refused("ot[alpha]").contains("an option is `alpha`; it must be KEY=VALUE"));
        assert!(
            refused("ot[gama=1]").contains("an option is `gama` (did you mean gamma?); it must be one of alpha, gamma")
        );
        assert!(refused("ot[xyz=1]").ends_with("an option is `xyz`; it must be one of alpha, gamma, phi"));
    }
}
