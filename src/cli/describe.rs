//! `vernis describe`: what a BRDF is, and what its descriptors say of it; or which materials a collection holds.

use super::{Shared, plausible, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use serde_json::{Map, Value, json};
use vernis_metric::brdf::models::{AnalyticBrdf, Field};
use vernis_metric::brdf::plausibility::Plausibility;
use vernis_metric::brdf::{Brdf, Grid, OpenBrdf, collection};
use vernis_metric::descriptor::{BrdfFeatures, DescriptorSet, Family, Setup, VERSION};
use vernis_metric::io::{counted, decimals, number, shown};
use vernis_metric::math::coordinates::standard_directions;

/// Tables of hundreds of parameters are for `--json`.
const MOST_FIELDS: usize = 16;

/// Describe one BRDF: what it is, and its descriptors. Of an archive, a file of fits or npf.bin, list the materials.
#[derive(Args)]
#[command(after_help = "\
Examples:
  vernis describe alum-bronze.binary
  vernis describe merl_nbrdf.zip               # the materials of an archive
  vernis describe merl_nbrdf.zip:teflon --json
  vernis describe chm_orange_rgb.bsdf
  vernis describe ward.json --descriptors      # what each descriptor means")]
pub struct DescribeArgs {
    /// The BRDF, as `vernis compare --help` describes; or an archive, a file of fits or npf.bin without a material.
    brdf: String,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Explain every descriptor of a pair: name, unit, meaning, source.
    #[arg(long)]
    descriptors: bool,
}

pub fn run(shared: &Shared, args: DescribeArgs) -> Result<()> {
    if let Some(materials) = collection(&args.brdf, shared.data.as_deref()).map_err(user_error)? {
        return list(&args.brdf, &materials, args.json);
    }
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
    let found = Plausibility::of(open.brdf.as_ref());
    if args.json {
        return print(serde_json::to_string_pretty(&to_json(&open, &found, &context, &setup))? + "\n");
    }
    workspace::warn(plausible::warnings(&args.brdf, &found));
    let mut text = to_text(&open, &found, &context);
    if args.descriptors {
        text += "\ndescriptors of a pair:\n";
        for d in DescriptorSet::compact().descriptions() {
            text += &format!("  {:22} [{}] {} ({})\n", d.column.name, d.unit, d.meaning, d.source);
        }
    }
    print(text)
}

fn list(notation: &str, materials: &[String], json: bool) -> Result<()> {
    if json {
        let value = json!({"collection": notation, "materials": materials});
        return print(serde_json::to_string_pretty(&value)? + "\n");
    }
    let name = shown(notation, 200);
    let mut text = match materials {
        [] => format!("{name} holds no material\n"),
        [first, ..] => {
            format!(
                "{name} holds {}, each a BRDF such as {name}:{}\n",
                counted(materials.len(), "material"),
                shown(first, 200)
            )
        }
    };
    text.extend(materials.iter().map(|material| format!("  {}\n", shown(material, 200))));
    print(text)
}

fn to_json(open: &OpenBrdf, found: &Plausibility, context: &[(String, String, f64)], setup: &Setup) -> Value {
    let brdf = open.brdf.as_ref();
    let descriptors: Map<_, _> = context.iter().map(|(name, _, value)| (name.clone(), json!(value))).collect();
    let parameters = brdf.as_model().map(|model| {
        let value = |field: &Field| if let [one] = field.values[..] { json!(one) } else { json!(field.values) };
        Field::all(model).iter().map(|field| (field.name.clone(), value(field))).collect::<Map<_, _>>()
    });
    json!({
        "brdf": open.notation, "sha256": open.content.to_string(),
        "description": brdf.description(),
        "model": brdf.as_model().map(AnalyticBrdf::model), "parameters": parameters,
        "cells": brdf.as_table().map(|t| t.grid().shape()), "valid_cells": brdf.as_table().map(|_| valid_cells(brdf)),
        "mirror": MIRROR.map(|deg| json!({"theta_deg": deg, "rgb": mirror_value(brdf, deg)})),
        "albedo": plausible::albedo_json(found),
        "warnings": plausible::warnings(&open.notation, found),
        "descriptors": descriptors,
        "versions": {"vernis": env!("CARGO_PKG_VERSION"), "descriptors": VERSION, "setup": setup.id()},
    })
}

fn to_text(open: &OpenBrdf, found: &Plausibility, context: &[(String, String, f64)]) -> String {
    let brdf = open.brdf.as_ref();
    let mut text = format!("{}\nsha256 {}\n", shown(&open.notation, 500), open.content);
    text.extend(brdf.description().map(|description| shown(&description, 500) + "\n"));
    text.extend(brdf.as_model().map(parameters));
    if let Some(grid) = brdf.as_table().map(|t| t.grid()) {
        let [a, b, c] = grid.shape();
        let kind = if matches!(grid, Grid::Standard { .. }) { "standard" } else { "half/difference" };
        let valid = valid_cells(brdf);
        text += &format!("table of {a} x {b} x {c} cells in {kind} coordinates, {valid} of {} measured\n", grid.len());
    }
    for deg in MIRROR {
        text += &match mirror_value(brdf, deg) {
            Some(rgb) => format!("mirror direction at {deg:2} deg: {} 1/sr\n", rgb.map(|v| decimals(v, 4)).join(" ")),
            None => format!("mirror direction at {deg:2} deg: not measured\n"),
        };
    }
    text += &plausible::albedo_text(found);
    text += "\ndescriptors of the BRDF alone:\n";
    text.extend(
        context.iter().map(|(name, meaning, value)| format!("  {name:18} {:>9}  {meaning}\n", decimals(*value, 4))),
    );
    text
}

/// A line for the model and one for each of its parameters.
fn parameters(model: &dyn AnalyticBrdf) -> String {
    let fields = Field::all(model);
    let mut text = format!("model {}\n", model.model());
    if fields.len() > MOST_FIELDS {
        return text + &format!("  {} parameters; --json lists them\n", model.parameters().len());
    }
    let width = fields.iter().map(|field| field.name.len()).max().unwrap_or(0);
    for Field { name, unit, values } in &fields {
        let numbers: Vec<String> = values.iter().map(|v| number(*v)).collect();
        let unit = if *unit == "1" { String::new() } else { format!(" {unit}") };
        text += &format!("  {name:width$}  {}{unit}\n", numbers.join(" "));
    }
    text
}

fn valid_cells(brdf: &dyn Brdf) -> usize {
    brdf.as_table().map_or(0, |table| table.valid().iter().filter(|v| **v).count())
}

/// Where the mirror directions are shown, degrees from the normal.
const MIRROR: [f64; 3] = [0.0, 30.0, 60.0];

/// The value where a mirror would reflect, for light at `theta_deg` from the normal.
fn mirror_value(brdf: &dyn Brdf, theta_deg: f64) -> Option<[f64; 3]> {
    let theta = theta_deg.to_radians();
    let (wi, wo) = standard_directions(theta, theta, std::f64::consts::PI);
    brdf.eval(wi, wo)
}
