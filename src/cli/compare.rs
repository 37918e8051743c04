//! `vernis compare`: two BRDFs, any number of metrics.

use super::workspace::MetricChoice;
use super::{Shared, plausible, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use serde_json::{Map, Value, json};
use std::sync::Arc;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::brdf::plausibility::Plausibility;
use vernis_metric::io::decimals;
use vernis_metric::metric::registry::{Distance, distances, distances_kept};
use vernis_metric::metric::{Metric, learned};

/// Compare two BRDFs.
#[derive(Args)]
#[command(after_help = "\
A BRDF is written as
  PATH.binary, PATH.titopo, PATH.titopoh          a table
  PATH.bsdf                                       a measurement of the RGL database, isotropic and in RGB
  PATH.h5                                         an NBRDF network
  ARCHIVE.zip:MATERIAL                            any of these in an archive
  FILE.fit:MATERIAL[?KEY=VALUE&...]               a published fit, with overrides
  npf.bin:MATERIAL                                tabulated factors
  MODEL.json[?KEY=VALUE&...]                      a model and its parameters
  SOURCE?fit=dupuy                                what any of these gives without a search: dupuy, dupuy-ggx or dupuy-beckmann

Examples:
  vernis compare alum-bronze.binary ward.json
  vernis compare merl_nbrdf.zip:teflon 'low_lowmicrofacet_E2.fit:teflon?eta=2.5' --metric vernis --metric D9.Cl
  vernis compare a.binary b.binary --metric all-lp --json
  vernis compare a.binary b.binary --metric ot --metric 'energy[phi=log:eta=0.01,alpha=0.05]' --per-channel
  vernis compare a.json b.json --metric ot --grid 9x9x36 --per-channel --json
  vernis compare a.binary b.binary --metric out/synthetic/vernis-synthetic.vernis.json")]
pub struct CompareArgs {
    /// The reference.
    reference: String,
    /// The candidate that approximates it.
    candidate: String,
    #[command(flatten)]
    choice: MetricChoice,
    /// Print JSON: {"distances": {name: value}, "mos": {name: {"mos", "low", "high", "scale": {"worst", "best"}}}, "versions": {name:
    /// version}, "albedo", "warnings"}.
    #[arg(long)]
    json: bool,
    /// Also print the distance of each channel. Lp metrics other than D6 and lab, and those on graphs, have one; learned metrics,
    /// D6 and lab take the channels together.
    #[arg(long)]
    per_channel: bool,
}

pub fn run(shared: &Shared, args: CompareArgs) -> Result<()> {
    let metrics = args.choice.metrics(shared)?;
    let (found, looks) = match metrics.iter().any(|metric| metric.properties().family == learned::FAMILY) {
        true => kept(shared, &metrics, &args)?,
        false => computed(shared, &metrics, &args)?,
    };
    if args.per_channel && found.iter().all(|d| d.channels.is_none()) {
        let names = found.iter().map(|d| d.metric.as_str()).collect::<Vec<_>>().join(", ");
        return Err(user_error(format!(
            "--per-channel needs a metric with a distance of each channel, and none of {names} has one; Lp metrics other than D6 \
             and lab, ot, energy and mmd-* do"
        )));
    }
    let mut warnings = plausible::warnings(&args.reference, &looks[0]);
    if args.reference != args.candidate {
        warnings.extend(plausible::warnings(&args.candidate, &looks[1]));
    }
    if args.json {
        let mut all = to_json(&found, args.per_channel);
        let [reference, candidate] = looks.map(|look| plausible::albedo_json(&look));
        all["albedo"] = json!({"reference": reference, "candidate": candidate});
        all["warnings"] = json!(warnings);
        all["versions"] = metrics.iter().map(|m| (m.name().to_owned(), json!(m.version()))).collect();
        return print(serde_json::to_string_pretty(&all)? + "\n");
    }
    workspace::warn(warnings);
    let mut text = to_text(&found, args.per_channel);
    if metrics.iter().any(|metric| metric.properties().synthetic) {
        text += "SYNTHETIC: a metric above was trained on simulated observers; its scores say nothing about people.\n";
    }
    print(text)
}

/// What metrics say, and how plausible both BRDFs are.
type Found = (Vec<Distance>, [Plausibility; 2]);

/// Of BRDFs that are decoded: most metrics read every value.
fn computed(shared: &Shared, metrics: &[Arc<dyn Metric>], args: &CompareArgs) -> Result<Found> {
    let reference = workspace::open_unhashed(&args.reference, shared.data.as_deref())?;
    let candidate = workspace::open_unhashed(&args.candidate, shared.data.as_deref())?;
    workspace::warm_up(shared, metrics)?;
    let found = distances(metrics, &*reference, &*candidate).map_err(user_error)?;
    Ok((found, [&reference, &candidate].map(|brdf| Plausibility::of(&**brdf))))
}

/// With what the cache keeps of each BRDF by its content: for learned metrics that is all they need.
fn kept(shared: &Shared, metrics: &[Arc<dyn Metric>], args: &CompareArgs) -> Result<Found> {
    let Some(cache) = workspace::cache(shared)? else { return computed(shared, metrics, args) };
    let identify = |notation: &str| BrdfSource::parse(notation)?.identify(shared.data.as_deref());
    let (reference, candidate) = rayon::join(|| identify(&args.reference), || identify(&args.candidate));
    let (reference, candidate) = (reference.map_err(user_error)?, candidate.map_err(user_error)?);
    let (found, warnings) = distances_kept(metrics, &reference, &candidate, &cache).map_err(user_error)?;
    workspace::warn(warnings);
    let looks = [plausible::kept(&reference, &cache)?, plausible::kept(&candidate, &cache)?];
    Ok((found, looks))
}

fn to_json(found: &[Distance], per_channel: bool) -> Value {
    let mut distances = Map::new();
    let mut mos = Map::new();
    let mut channels = Map::new();
    for d in found {
        distances.insert(d.metric.clone(), json!(d.value));
        if let Some(s) = d.score {
            mos.insert(d.metric.clone(), json!({"mos": s.mos, "low": s.low, "high": s.high, "scale": s.scale}));
        }
        if let Some(c) = d.channels {
            channels.insert(d.metric.clone(), json!(c));
        }
    }
    let mut all = json!({"distances": distances, "mos": mos});
    if per_channel {
        all["channels"] = Value::Object(channels);
        let without: Vec<_> = found.iter().filter(|d| d.channels.is_none()).map(|d| d.metric.as_str()).collect();
        all["without_channels"] = json!(without);
    }
    all
}

fn to_text(found: &[Distance], per_channel: bool) -> String {
    let width = found.iter().map(|d| d.metric.len()).max().unwrap_or(0);
    let mut text = String::new();
    for d in found {
        text += &format!("{:width$}  {:<12}", d.metric, decimals(d.value, 6));
        if let Some(s) = d.score {
            text += &format!("  {s}");
        }
        match d.channels {
            Some([r, g, b]) if per_channel => {
                text += &format!("  R {}  G {}  B {}", number(r), number(g), number(b));
            }
            None if per_channel => text += "  (no distance of each channel: it takes them together)",
            _ => (),
        }
        text = text.trim_end().to_owned() + "\n";
    }
    text
}

/// Six decimals, or as many digits where they would show nothing.
fn number(x: f64) -> String {
    if x == 0.0 || x.abs() >= 0.01 { decimals(x, 6) } else { format!("{x:.5e}") }
}
