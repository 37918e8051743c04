//! `vernis data convert`: a BRDF into a table of another format.

use super::super::output::{self, Inputs, Replace};
use super::super::{Shared, plausible, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::formats::{merl, titopo};
use vernis_metric::brdf::{ConversionLoss, Grid, TabulatedBrdf, on_grid};

/// The figures are those of the test `the_losses_that_the_help_states`.
const LOSSES: &str = "\
Values are interpolated between samples. The loss for GGX of roughness 0.2, converted there and back: the median and the
99th percentile of the relative difference |a - b| / max(a, b) to the first table:

  .binary  -> .titopo  -> .binary     0.00059 and 0.0525
  .binary  -> .titopoh -> .binary     0.00158 and 0.1127
  .titopo  -> .binary  -> .titopo     0.00020 and 0.0058
  .titopo  -> .titopoh -> .titopo     0.00010 and 0.0137
  .titopoh -> .titopo  -> .titopoh    0 and 0
  .binary  with --phi 360 and back    0 and 0

Sharper highlights lose more: MERL resolves a hundredth of a degree around the highlight, Titopo one degree, half Titopo
two. MERL with 180 columns keeps one of the two values of a pair of directions that is seen from either side. Cells of
MERL below the horizon have no place in Titopo. Colours outside the gamut, which RGL's measurements have, lose their negative
components. The command prints the loss of the converted table and the albedo of what was read.

Examples:
  vernis data convert alum-bronze.binary alum-bronze.titopo
  vernis data convert teflon.T.titopo teflon.binary --phi 360
  vernis data convert chm_orange_rgb.bsdf chm_orange.binary
  vernis data convert nbrdf/merl_nbrdf.zip:teflon teflon.titopoh --data ~/brdf-data";

#[derive(Args)]
#[command(after_long_help = LOSSES)]
pub struct ConvertArgs {
    /// The BRDF, as `vernis compare --help` describes.
    #[arg(value_name = "IN")]
    input: String,
    /// The table to write: .binary, .titopo or .titopoh.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Columns of a .binary: 180 (a reciprocal BRDF, which every reader supports) or 360.
    #[arg(long, value_name = "N", default_value = "180", value_parser = PossibleValuesParser::new(["180", "360"]))]
    phi: String,
    #[command(flatten)]
    replace: Replace,
}

pub fn run(shared: &Shared, args: ConvertArgs) -> Result<()> {
    let grid = grid_of(&args.output, &args.phi)?;
    output::file(&args.output, &Inputs::default().notation(&args.input, shared.data.as_deref()), args.replace)?;
    let brdf = workspace::open_unhashed(&args.input, shared.data.as_deref())?;
    let table = on_grid(&*brdf, grid).map_err(|e| user_error(format!("{}: {e}", args.input)))?;
    match grid {
        Grid::HalfDifference { .. } => merl::write(&args.output, &table)?,
        Grid::Standard { .. } => titopo::write(&args.output, &table)?,
    }
    let mut text =
        format!("{}: {}, {:.1} % of the cells hold a value\n", args.output.display(), name(grid), valid(&table));
    text += &match brdf.as_table() {
        None => "the value at every sample of a BRDF that is no table\n".to_owned(),
        Some(first) if first.grid() == grid => "the cells of the table that was read: nothing is lost\n".to_owned(),
        Some(first) => {
            let ConversionLoss { median, p99, missing } = ConversionLoss::of(first, grid).map_err(user_error)?;
            format!(
                "relative difference to {} after the way back: median {median:.5}, 99th percentile {p99:.5}; \
                 {:.2} % of its valid cells are lost\n",
                args.input,
                100.0 * missing
            )
        }
    };
    text += &plausible::albedo_text(&plausible::warn(&args.input, &*brdf));
    print(text)
}

fn grid_of(output: &Path, phi: &str) -> Result<Grid> {
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "binary" if phi == "360" => Ok(Grid::MERL_FULL),
        "binary" => Ok(Grid::MERL),
        "titopo" => Ok(Grid::TITOPO),
        "titopoh" => Ok(Grid::TITOPO_HALF),
        _ => {
            let path = output.display();
            Err(user_error(format!("{path} has the extension `{extension}`; it must be binary, titopo or titopoh")))
        }
    }
}

fn name(grid: Grid) -> String {
    let [a, b, c] = grid.shape();
    let coordinates = match grid {
        Grid::HalfDifference { .. } => "half/difference",
        Grid::Standard { .. } => "standard",
    };
    format!("{a} x {b} x {c} in {coordinates} coordinates")
}

fn valid(table: &TabulatedBrdf) -> f64 {
    100.0 * table.valid().iter().filter(|v| **v).count() as f64 / table.valid().len() as f64
}
