//! `vernis describe`: what a BRDF is, and what its descriptors say of it.

use super::{Shared, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use serde_json::json;
use vernis_metric::brdf::{Brdf, Grid};
use vernis_metric::descriptor::{BrdfFeatures, DescriptorSet, Family, Setup, VERSION};
use vernis_metric::math::coordinates::standard_directions;

/// Describe one BRDF: what it is, and its descriptors.
#[derive(Args)]
#[command(after_help = "\
Examples:
  vernis describe alum-bronze.binary
  vernis describe merl_nbrdf.zip:teflon --json
  vernis describe ward.json --descriptors      # what each descriptor means")]
pub struct DescribeArgs {
    /// The BRDF, as `vernis compare --help` describes.
    brdf: String,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Explain every descriptor of a pair: name, unit, meaning, source.
    #[arg(long)]
    descriptors: bool,
}

pub fn run(shared: &Shared, args: DescribeArgs) -> Result<()> {
    let open = workspace::open(&args.brdf, shared.data.as_deref())?;
    let setup = Setup::standard();
    let cache = workspace::cache(shared)?;
    workspace::warn(cache.as_ref().and_then(|c| c.prepare(&setup)));
    let features = BrdfFeatures::compute(open.brdf.as_ref(), &setup).map_err(user_error)?;
    let context: Vec<(String, String, f64)> = Family::Context
        .descriptions()
        .into_iter()
        .zip(features.context())
        .map(|(d, value)| (d.column.name, d.meaning, value))
        .collect();
    let table = open.brdf.as_table().map(|t| {
        let valid = t.valid().iter().filter(|v| **v).count();
        (t.grid(), valid)
    });
    let mirror = [0.0, 30.0, 60.0].map(|deg: f64| (deg, mirror_value(open.brdf.as_ref(), deg)));
    if args.json {
        let descriptors: serde_json::Map<_, _> =
            context.iter().map(|(name, _, value)| (name.clone(), json!(value))).collect();
        let value = json!({
            "brdf": open.notation, "sha256": open.content.to_string(),
            "cells": table.map(|(g, _)| g.shape()), "valid_cells": table.map(|(_, v)| v),
            "mirror": mirror.map(|(deg, rgb)| json!({"theta_deg": deg, "rgb": rgb})),
            "descriptors": descriptors,
            "versions": {"vernis": env!("CARGO_PKG_VERSION"), "descriptors": VERSION, "setup": setup.id()},
        });
        return print(serde_json::to_string_pretty(&value)? + "\n");
    }
    let mut text = format!("{}\nsha256 {}\n", open.notation, open.content);
    if let Some((grid, valid)) = table {
        let [a, b, c] = grid.shape();
        let kind = if matches!(grid, Grid::Standard { .. }) { "standard" } else { "half/difference" };
        text += &format!("table of {a} x {b} x {c} cells in {kind} coordinates, {valid} of {} measured\n", grid.len());
    }
    for (deg, rgb) in mirror {
        text += &match rgb {
            Some([r, g, b]) => format!("mirror direction at {deg:2} deg: {r:.4} {g:.4} {b:.4} 1/sr\n"),
            None => format!("mirror direction at {deg:2} deg: not measured\n"),
        };
    }
    text += "\ndescriptors of the BRDF alone:\n";
    text.extend(context.iter().map(|(name, meaning, value)| format!("  {name:18} {value:9.4}  {meaning}\n")));
    if args.descriptors {
        text += "\ndescriptors of a pair:\n";
        for d in DescriptorSet::compact().descriptions() {
            text += &format!("  {:22} [{}] {} ({})\n", d.column.name, d.unit, d.meaning, d.source);
        }
    }
    print(text)
}

/// The value where a mirror would reflect, for light at `theta_deg` from the normal.
fn mirror_value(brdf: &dyn Brdf, theta_deg: f64) -> Option<[f64; 3]> {
    let theta = theta_deg.to_radians();
    let (wi, wo) = standard_directions(theta, theta, std::f64::consts::PI);
    brdf.eval(wi, wo)
}
