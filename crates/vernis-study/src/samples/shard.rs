//! A part of a study, for machines that share the work.

use crate::dataset::Study;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Every `count`-th reference of a study with all of its candidates, beginning with the `number`-th: a reference is read on one
/// machine only. Written `number/count`, such as `3/8`; `1/1` is everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    number: usize,
    count: usize,
}

/// More parts than any study has references.
const MOST: usize = 1_000_000;

impl Shard {
    /// The whole study: 1/1.
    pub const WHOLE: Self = Self { number: 1, count: 1 };

    /// From 1 to [`Shard::count`].
    pub fn number(self) -> usize {
        self.number
    }

    /// How many shards the study is cut into.
    pub fn count(self) -> usize {
        self.count
    }

    /// The places of its pairs in `study`, in order.
    pub fn places(self, study: &Study) -> Vec<usize> {
        let of_shard = study.by_reference().into_iter().skip(self.number - 1).step_by(self.count);
        let mut places: Vec<usize> = of_shard.flatten().collect();
        places.sort_unstable();
        places
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parts = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((number, count)) if (1..=count).contains(&number) && count <= MOST => Ok(Self { number, count }),
            _ => Err(format!(
                "shard is `{text}`; it must be NUMBER/COUNT with NUMBER from 1 to COUNT and COUNT up to {MOST}, such as 3/8"
            )),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::synthetic;

    #[test]
    fn shards_divide_a_study_by_reference() {
        let study = Study::load(synthetic::NAME, None).unwrap();
        assert_eq!(Shard::WHOLE.places(&study), (0..study.pairs.len()).collect::<Vec<_>>());
        let shards: Vec<Vec<usize>> =
            (1..=7).map(|k| format!("{k}/7").parse::<Shard>().unwrap().places(&study)).collect();
        let mut all = shards.concat();
        all.sort_unstable();
        assert_eq!(all, (0..study.pairs.len()).collect::<Vec<_>>());
        let references = |places: &Vec<usize>| {
            places.iter().map(|&p| study.pairs[p].reference.identity()).collect::<std::collections::BTreeSet<_>>()
        };
        assert!((1..7).all(|k| references(&shards[k]).is_disjoint(&references(&shards[k - 1]))));
        // More shards than references: the last are empty.
        assert!("1000/1000".parse::<Shard>().unwrap().places(&study).is_empty());
    }

    #[test]
    fn the_notation_is_checked() {
        assert_eq!("3/8".parse::<Shard>().unwrap().to_string(), "3/8");
        for wrong in ["0/8", "9/8", "1/0", "3", "a/8", "3/8/1", "-1/8", "", "1/1000001", "1/99999999999999999999"] {
            let message = wrong.parse::<Shard>().unwrap_err();
            assert!(message.contains(&format!("shard is `{wrong}`; it must be NUMBER/COUNT")), "{message}");
        }
    }
}
