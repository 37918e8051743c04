//! `vernis extract` and `vernis merge`: a study, or a shard of it, as numbers in a Parquet file.

use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::study_input::StudyInput;
use super::{Shared, print, signals, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::further::Further;
use crate::experiment::train;
use crate::samples::extracted::{ExtractedStudy, Versions};
use crate::samples::further::further;
use crate::samples::shard::Shard;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_metric::descriptor::Setup;
use vernis_metric::io::counted;

/// Compute all descriptors and distances of a study, or of a shard of it, into a Parquet file.
#[derive(Args)]
#[command(after_help = "\
Reads every BRDF once; each worker thread holds one reference and one candidate at a time. The cache keeps finished work:
after an interruption (Ctrl-C, exit code 130; SIGTERM, 143) the same command continues where it stopped, and a finished file is
replaced by that of the next run. `vernis merge` joins shards; `vernis train --extracted` reads the whole.

Examples:
  vernis extract --study lavoue2021 --data ~/brdf-data --out out/whole
  vernis extract --study lavoue2021 --data ~/brdf-data --shard 3/8 --out shards
  vernis merge shards/*.parquet --out lavoue2021.parquet
  vernis train --extracted lavoue2021.parquet
  vernis extract --study lavoue2021-open --data ~/brdf-data --shard 1/4 --metric all-stimulus --cache /shared/cache")]
pub struct ExtractArgs {
    #[command(flatten)]
    input: StudyInput,
    /// Only every COUNT-th reference with its candidates, from the NUMBER-th on, to share the work between machines.
    #[arg(long, value_name = "NUMBER/COUNT", default_value = "1/1")]
    shard: Shard,
    /// Also compute the distances of a further metric, such as all-stimulus, and keep them in the cache; may be given several times. The
    /// file does not hold them: `vernis benchmark --metric` with the same --cache finds them there, so that machines which share a cache
    /// folder share the rendering.
    #[arg(long = "metric", short = 'm', value_name = "NAME")]
    metrics: Vec<String>,
    /// Folder for the file STUDY.parquet or STUDY-NUMBER-of-COUNT.parquet [default: out/STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Join the Parquet files of all shards of a study.
#[derive(Args)]
#[command(after_help = "\
Checks that each shard is given once and that all belong to one study and one version of vernis.

Examples:
  vernis merge shards/*.parquet --out lavoue2021.parquet")]
pub struct MergeArgs {
    /// The files of `vernis extract --shard`, in any order.
    #[arg(required = true, value_name = "PARQUET")]
    files: Vec<PathBuf>,
    /// Parquet file to write: the same bytes that `vernis extract` writes without --shard.
    #[arg(long, value_name = "PARQUET")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

pub fn extract(shared: &Shared, args: ExtractArgs) -> Result<()> {
    let study = args.input.study(shared)?;
    let further_metrics = match args.metrics.is_empty() {
        true => Further::default(),
        false => {
            let metrics = workspace::metrics(shared, &args.metrics, &args.input.view.options())?;
            Further::new(metrics, &study).map_err(workspace::experiment_error)?
        }
    };
    let setup = Setup::new(&args.input.view.options()).map_err(user_error)?;
    let places = args.shard.places(&study);
    let short = study.short_name();
    let name = match args.shard {
        Shard::WHOLE => format!("{short}.parquet"),
        // As many digits for all, so that names sort.
        shard => format!("{short}-{:0width$}-of-{}.parquet", shard.number(), shard.count(), width = digits(shard)),
    };
    let default = || Path::new("out").join(&short);
    let folder = output::folder(args.out.as_deref(), default, &[&name], &args.input.inputs(), Replace::CONTINUES)?;
    let cache = workspace::cache(shared)?;
    if cache.is_none() && !further_metrics.metrics().is_empty() {
        return Err(user_error("--metric needs a cache, where its distances are kept; name a folder with --cache"));
    }
    let of_shard = Study { pairs: places.iter().map(|&place| study.pairs[place].clone()).collect(), ..study.clone() };
    let bar = Bar::new();
    let kept = match &cache {
        Some(_) => format!(
            "the pairs that are finished are kept in {}; the same command continues from there",
            workspace::cache_folder(shared).display()
        ),
        None => "there is no cache, and the next run begins anew".to_owned(),
    };
    signals::resumable(&bar, kept)?;
    let progress = |stage: &str, progress| bar.update(stage, progress);
    let found = train::extract(&of_shard, &setup, shared.data.as_deref(), cache.as_ref(), &progress);
    let found = found.map_err(workspace::experiment_error)?;
    if !further_metrics.metrics().is_empty() {
        let told = |p| bar.update("further metrics", p);
        let (data, metrics) = (shared.data.as_deref(), further_metrics.metrics());
        let kept = further(&of_shard, metrics, data, cache.as_ref(), &told);
        workspace::warn(kept.map_err(|e| workspace::experiment_error(e.into()))?.1);
    }
    bar.finish();
    workspace::warn(&found.warnings);
    let extracted = ExtractedStudy {
        study: of_shard,
        samples: found.samples,
        contents: found.contents,
        shard: args.shard,
        places,
        whole: study.pairs.len(),
        versions: Versions::new(setup.id(), &train::metrics(&study)?),
    };
    let path = folder.write(&name, &extracted.to_parquet()?)?;
    print(format!("{} of {}: {}\n", extracted.places.len(), counted(extracted.whole, "pair"), path.display()))
}

fn digits(shard: Shard) -> usize {
    shard.count().to_string().len()
}

pub fn merge(args: MergeArgs) -> Result<()> {
    let (folder, name) = output::file(&args.out, &Inputs::default().files(&args.files), args.replace)?;
    let read = |path: &PathBuf| Ok((path.display().to_string(), ExtractedStudy::load(path).map_err(user_error)?));
    let parts = args.files.iter().map(read).collect::<Result<Vec<_>>>()?;
    let whole = ExtractedStudy::merge(parts).map_err(user_error)?;
    let path = folder.write(&name, &whole.to_parquet()?)?;
    let (pairs, files) = (counted(whole.places.len(), "pair"), counted(args.files.len(), "file"));
    print(format!("{pairs} of {files}: {}\n", path.display()))
}
