//! `vernis manifold`: approximations of a reference that lie on a manifold through many.

use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::scale::ScaleArgs;
use super::{Shared, limits, print, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::refit::file_name;
use crate::report::spreadsheet::cell;
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::brdf::formats::{merl, titopo};
use vernis_metric::brdf::{Brdf, BrdfError, BrdfSource, Grid, TabulatedBrdf};
use vernis_metric::descriptor::DescriptorOptions;
use vernis_metric::fit::manifold::{Kind, Manifold, SAMPLES};
use vernis_metric::io::Progress;
use vernis_metric::metric::Metric;
use vernis_metric::metric::registry::distances;

/// Make the six approximations of a reference that lie on a manifold through many references.
#[derive(Args)]
#[command(after_help = "\
Writes MATERIAL.manifold.1 to 6, each further from the reference, and their distances as MATERIAL.manifold.csv; says whether
the distances grow. Memory: 18 MB per reference for .titopoh and 70 MB for .titopo or .binary. The study's ratings belong to its
own samples (GPLVM_APPROX.1 to 6), which come from another manifold: these samples have no ratings.

Examples:
  vernis manifold --study lavoue2021-open --material teflon --data DIR --out samples
  vernis manifold --reference a.binary --reference b.binary --reference c.binary --material a.binary --out samples")]
pub struct ManifoldArgs {
    /// A study by name, or a CSV file, whose references span the manifold.
    #[arg(long, value_name = "NAME|CSV", required_unless_present = "reference", conflicts_with = "reference")]
    study: Option<String>,
    #[command(flatten)]
    scale: ScaleArgs,
    /// A BRDF that spans the manifold, as `vernis compare --help` describes; give several.
    #[arg(long, value_name = "BRDF")]
    reference: Vec<String>,
    /// The reference to approximate: a material of the study, or one of the references.
    #[arg(long, value_name = "NAME|BRDF")]
    material: String,
    /// How references become points: latent variables of a Gaussian process, as in the study, or principal components.
    #[arg(long, value_enum, default_value = "gplvm")]
    kind: KindName,
    /// Dimensions of the manifold, 1 to 1000 and fewer than the references [default: 4 latent variables, or all principal components].
    #[arg(long, value_name = "N", value_parser = limits::integer(1..=1000_usize))]
    dimension: Option<usize>,
    /// Seed of the direction in which the samples leave the reference.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Kind of table to write.
    #[arg(long, value_enum, default_value = "titopoh")]
    format: Format,
    /// A metric whose distances are reported; may be given several times.
    #[arg(long, short = 'm', value_name = "NAME|FILE", default_values = ["D9.Cl", "D4.Cl.CR"])]
    metric: Vec<String>,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum KindName {
    /// Gaussian process latent variable model.
    Gplvm,
    /// Principal components.
    Linear,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// 45 x 45 x 180 in standard coordinates.
    Titopoh,
    /// 90 x 90 x 360 in standard coordinates.
    Titopo,
    /// 90 x 90 x 180 in half/difference coordinates, as MERL.
    Binary,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Titopoh => "titopoh",
            Self::Titopo => "titopo",
            Self::Binary => "binary",
        }
    }

    fn grid(self) -> Grid {
        match self {
            Self::Titopoh => Grid::TITOPO_HALF,
            Self::Titopo => Grid::TITOPO,
            Self::Binary => Grid::MERL,
        }
    }

    fn write(self, path: &Path, table: &TabulatedBrdf) -> Result<(), BrdfError> {
        match self {
            Self::Titopoh | Self::Titopo => titopo::write(path, table),
            Self::Binary => merl::write(path, table),
        }
    }
}

/// The references by name, sorted, each once.
fn references(shared: &Shared, args: &ManifoldArgs) -> Result<BTreeMap<String, BrdfSource>> {
    match &args.study {
        Some(name) => {
            let study = Study::load_on(name, shared.data.as_deref(), args.scale.declared).map_err(user_error)?;
            Ok(study.pairs.into_iter().map(|p| (p.material, p.reference)).collect())
        }
        None => {
            let parse = |text: &String| Ok((text.clone(), BrdfSource::parse(text).map_err(user_error)?));
            args.reference.iter().map(parse).collect()
        }
    }
}

/// One sample: its file and its distances from the reference, in the order of the metrics.
struct Sample {
    path: PathBuf,
    distances: Vec<f64>,
}

pub fn run(shared: &Shared, args: ManifoldArgs) -> Result<()> {
    let metrics = workspace::metrics(shared, &args.metric, &DescriptorOptions::default())?;
    let sources = references(shared, &args)?;
    let Some(index) = sources.keys().position(|name| *name == args.material) else {
        let known = sources.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        return Err(user_error(format!("--material is {}; it must be one of {known}", args.material)));
    };
    let stem = file_name(Path::new(&args.material).file_name().and_then(|n| n.to_str()).unwrap_or(&args.material));
    let table = |i: usize| format!("{stem}.manifold.{i}.{}", args.format.extension());
    let names: Vec<String> = (1..=SAMPLES).map(table).chain([format!("{stem}.manifold.csv")]).collect();
    let data = shared.data.as_deref();
    let inputs = Inputs::default().files(&args.study).files(&args.metric).sources(sources.values(), data);
    let folder = output::folder(Some(&args.out), PathBuf::new, &names, &inputs, args.replace)?;
    let bar = Bar::new();
    let told = |done| bar.update("manifold samples", Progress { done, total: SAMPLES });
    told(0);
    let open = |source: &BrdfSource| source.open_unhashed(shared.data.as_deref()).map_err(user_error);
    let opened = sources.values().map(open).collect::<Result<Vec<_>>>()?;
    let borrowed: Vec<&dyn Brdf> = opened.iter().map(|brdf| &**brdf).collect();
    let kind = match args.kind {
        KindName::Gplvm => Kind::Latent,
        KindName::Linear => Kind::Linear,
    };
    let manifold = Manifold::new(kind, &borrowed, args.format.grid(), args.dimension).map_err(user_error)?;
    let reference = TabulatedBrdf::tabulate(borrowed[index], args.format.grid()).map_err(user_error)?;
    let sample = |i: usize| -> Result<Sample> {
        let table = manifold.sample(index, i, args.seed).map_err(user_error)?;
        let path = folder.path().join(&names[i - 1]);
        args.format.write(&path, &table)?;
        let distances = distances(&metrics, &reference, &table).map_err(user_error)?;
        told(i);
        Ok(Sample { path, distances: distances.into_iter().map(|d| d.value).collect() })
    };
    let samples = (1..=SAMPLES).map(sample).collect::<Result<Vec<_>>>();
    bar.finish();
    let samples = samples?;
    folder.write(&format!("{stem}.manifold.csv"), &to_csv(&samples, &metrics)?)?;
    let (dimension, stop) = (manifold.dimension(), manifold.stop().name());
    let mut text = format!("dimensions: {dimension}, references: {}, search for their points: {stop}\n", sources.len());
    for (m, metric) in metrics.iter().enumerate() {
        let values: Vec<f64> = samples.iter().map(|s| s.distances[m]).collect();
        let shown: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
        let grows = values.windows(2).all(|w| w[0] < w[1]);
        let verdict = if grows { "grows with every sample" } else { "DOES NOT GROW with every sample" };
        text += &format!("{:12} {}  {verdict}\n", metric.name(), shown.join("  "));
    }
    samples.iter().for_each(|s| text += &format!("{}\n", s.path.display()));
    print(text)
}

fn to_csv(samples: &[Sample], metrics: &[Arc<dyn Metric>]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = metrics.iter().map(|m| cell(m.name()).into_owned());
    writer.write_record(["sample", "file"].map(str::to_owned).into_iter().chain(names))?;
    for (k, sample) in samples.iter().enumerate() {
        let file = sample.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let numbers = sample.distances.iter().map(f64::to_string);
        writer.write_record([(k + 1).to_string(), cell(&file).into_owned()].into_iter().chain(numbers))?;
    }
    Ok(writer.into_inner().map_err(|e| e.into_error())?)
}
