//! On which scale a study was rated, as its manifest, the TOML file of its raw ratings or the command line declares it.
//!
//! ```toml
//! scale = {worst = 0, best = 100}    # or [0, 100], worst first; best may be the smaller number
//! scale = "jod"                      # mos: 1 to 5; jod: 10 is best, no worst end; dmos: 0 is best, larger is worse, no worst end
//! ```
//!
//! A scale without a worst end (`worst = -inf`, or `inf` where larger is worse) ends where the ratings of the study do, rounded
//! outwards to a whole number: a metric does not say what nobody rated.

use serde::Deserialize;
use std::fmt;
use std::str::FromStr;
use vernis_metric::math::rating_scale::RatingScale;

/// What a scale may be called in place of its ends.
const NAMED: [(&str, DeclaredScale); 3] =
    [("mos", DeclaredScale::MOS), ("jod", DeclaredScale::JOD), ("dmos", DeclaredScale::DMOS)];

/// A scale whose worst end need not exist.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "Written")]
pub struct DeclaredScale {
    /// Infinite where there is no worst end.
    worst: f64,
    best: f64,
}

/// The forms in a TOML file.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "scale must be {worst = NUMBER, best = NUMBER}, [WORST, BEST], \"mos\", \"jod\" or \"dmos\", such as {worst = 0, best = 100}"
)]
enum Written {
    Name(String),
    Ends([f64; 2]),
    Table(Table),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    worst: f64,
    best: f64,
}

impl TryFrom<Written> for DeclaredScale {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Name(name) => name.parse(),
            Written::Ends([worst, best]) | Written::Table(Table { worst, best }) => Self::new(worst, best),
        }
    }
}

impl DeclaredScale {
    /// Mean opinion scores of five grades, 1 (very poor) to 5 (excellent): what holds where nothing is declared.
    pub const MOS: Self = Self { worst: 1.0, best: 5.0 };
    /// Just objectionable differences: the reference has 10, and there is no worst end.
    pub const JOD: Self = Self { worst: f64::NEG_INFINITY, best: 10.0 };
    /// Differences of mean opinion scores from the reference's: 0 is best, larger is worse, and there is no worst end.
    pub const DMOS: Self = Self { worst: f64::INFINITY, best: 0.0 };

    /// # Errors
    /// Ends that are no numbers or equal, or a best end that is infinite.
    pub fn new(worst: f64, best: f64) -> Result<Self, String> {
        if best.is_finite() && (worst.is_infinite() || RatingScale::new(worst, best).is_ok()) {
            return Ok(Self { worst, best });
        }
        Err(format!("the scale has worst {worst} and best {best}; they must differ, and best must be finite"))
    }

    /// What declares `scale`.
    pub fn of_scale(scale: RatingScale) -> Self {
        let open = scale.is_open().then_some(f64::INFINITY * -scale.direction());
        Self { worst: open.unwrap_or(scale.worst()), best: scale.best() }
    }

    /// Whether a score lies on the scale.
    pub fn contains(self, score: f64) -> bool {
        score.is_finite() && self.worst.min(self.best) <= score && score <= self.worst.max(self.best)
    }

    /// Whether larger scores are better.
    pub fn larger_is_better(self) -> bool {
        self.best > self.worst
    }

    /// What `contains` takes, in words.
    pub fn allowed(self) -> String {
        match RatingScale::new(self.worst, self.best) {
            Ok(scale) => scale.to_string(),
            Err(_) if self.larger_is_better() => format!("at most {} (best)", self.best),
            Err(_) => format!("at least {} (best)", self.best),
        }
    }

    /// The scale of a study with these ratings.
    ///
    /// # Errors
    /// A scale without a worst end, on which no rating is worse than the best.
    pub fn of_ratings(self, ratings: impl IntoIterator<Item = f64>) -> Result<RatingScale, String> {
        if self.worst.is_finite() {
            return RatingScale::new(self.worst, self.best);
        }
        let worst = ratings.into_iter().fold(self.best, if self.larger_is_better() { f64::min } else { f64::max });
        let outwards = if self.larger_is_better() { worst.floor() } else { worst.ceil() };
        let scale = RatingScale::new(outwards, self.best).map(RatingScale::opened);
        scale.map_err(|_| format!("all ratings are {}, the best of the scale; some must be worse", self.best))
    }
}

impl FromStr for DeclaredScale {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some((_, scale)) = NAMED.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)) {
            return Ok(*scale);
        }
        let wrong = || {
            format!(
                "`{text}` is no scale; it must be mos (1 to 5), jod, dmos, or worst=NUMBER,best=NUMBER, such as \
                 worst=0,best=100 (worst=-inf, or inf where larger is worse, for a scale without a worst end)"
            )
        };
        let mut ends = [None; 2];
        for part in text.split(',') {
            let (key, number) = part.split_once('=').ok_or_else(wrong)?;
            let place = ["worst", "best"].iter().position(|end| *end == key.trim()).ok_or_else(wrong)?;
            let number = number.trim().parse::<f64>().map_err(|_| wrong())?;
            if ends[place].replace(number).is_some() {
                return Err(wrong());
            }
        }
        let [Some(worst), Some(best)] = ends else { return Err(wrong()) };
        Self::new(worst, best)
    }
}

/// As the command line takes it: `mos`, `jod`, `dmos`, `worst=0,best=100`.
impl fmt::Display for DeclaredScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match NAMED.iter().find(|(_, scale)| scale == self) {
            Some((name, _)) => f.write_str(name),
            None => write!(f, "worst={},best={}", self.worst, self.best),
        }
    }
}

/// What a message about a score beyond 1 to 5 adds, where nobody declared a scale.
pub(super) const HOW_TO_DECLARE: &str =
    "if the study uses another scale, say so: --scale worst=0,best=100, --scale jod or --scale dmos";

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(worst: f64, best: f64) -> DeclaredScale {
        DeclaredScale::new(worst, best).unwrap()
    }

    #[test]
    fn scales_are_read_as_they_are_shown() {
        for (text, expected) in [
            ("mos", DeclaredScale::MOS),
            ("DMOS", DeclaredScale::DMOS),
            ("worst=0,best=100", scale(0.0, 100.0)),
            (" best = 0 , worst = 9.5 ", scale(9.5, 0.0)),
            ("worst=-inf,best=10", DeclaredScale::JOD),
        ] {
            let found: DeclaredScale = text.parse().unwrap();
            assert_eq!((found, found.to_string().parse()), (expected, Ok(expected)), "{text}");
        }
        for text in [
            "",
            "0-100",
            "0,100",
            "worst=0",
            "worst=0,best=0",
            "worst=0,best=1,best=2",
            "worst=0,best=inf",
            "worst=a,best=1",
        ] {
            assert!(text.parse::<DeclaredScale>().is_err(), "{text}");
        }
        assert!("0-100".parse::<DeclaredScale>().unwrap_err().contains("such as worst=0,best=100"));
    }

    #[test]
    fn a_file_states_a_scale_in_any_of_its_forms() {
        #[derive(Debug, Deserialize)]
        struct File {
            scale: DeclaredScale,
        }
        let read = |text: &str| toml::from_str::<File>(text).map(|f| f.scale).map_err(|e| e.to_string());
        for text in ["scale = {worst = 0, best = 100}", "scale = [0, 100]", "scale = \"worst=0,best=100\""] {
            assert_eq!(read(text), Ok(scale(0.0, 100.0)), "{text}");
        }
        assert_eq!(read("scale = {worst = inf, best = 0}"), Ok(DeclaredScale::DMOS));
        for text in
            ["scale = 100", "scale = {worst = 0}", "scale = [0, 50, 100]", "scale = {worst = 0, best = 1, mid = 2}"]
        {
            assert!(read(text).unwrap_err().contains("such as {worst = 0, best = 100}"), "{text}");
        }
        assert!(read("scale = [5, 5]").unwrap_err().contains("worst 5 and best 5; they must differ"));
    }

    #[test]
    fn an_open_scale_ends_where_its_ratings_do() {
        let of = |scale: DeclaredScale, ratings: &[f64]| scale.of_ratings(ratings.iter().copied());
        let jod = of(DeclaredScale::JOD, &[9.2, 4.4, 7.1]).unwrap();
        assert_eq!((jod.worst(), jod.best(), jod.is_open()), (4.0, 10.0, true));
        let dmos = of(DeclaredScale::DMOS, &[1.2, 7.1, 4.0]).unwrap();
        assert_eq!((dmos.worst(), dmos.grade(0.0), dmos.direction()), (8.0, 5.0, -1.0));
        assert_eq!(DeclaredScale::of_scale(dmos), DeclaredScale::DMOS);
        assert_eq!(of(scale(0.0, 100.0), &[]), RatingScale::new(0.0, 100.0));
        assert!(of(DeclaredScale::JOD, &[10.0, 10.0]).unwrap_err().contains("all ratings are 10"));
        assert!(DeclaredScale::JOD.contains(-3.0) && !DeclaredScale::JOD.contains(10.5));
        assert!(!DeclaredScale::DMOS.contains(f64::INFINITY) && !DeclaredScale::DMOS.contains(-0.1));
        assert_eq!(DeclaredScale::DMOS.allowed(), "at least 0 (best)");
    }
}
