//! `vernis compare-images`: two pictures, any number of metrics.

use super::output::{Inputs, Replace};
use super::{Shared, output, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_image::display::Display;
use vernis_image::metric::{Comparison, Conditions, DifferenceMap, ImageMetric, ImageMetricError, ImageRegistry};
use vernis_image::picture::EncodedPicture;
use vernis_image::picture::read::read;
use vernis_metric::io::decimals;

/// Compare two pictures.
#[derive(Args)]
#[command(after_help = "\
Pictures are PNG or JPEG (sRGB codes), or OpenEXR, Radiance HDR or PFM (linear light of BT.709 in cd/m2), both of one kind and size.
An EXR file of `vernis render` holds light in the unit of its light probe, which is far darker in cd/m2 than a screen: compare its PNG
files.

  ssim, ssim-y709, ssim-rgb, ms-ssim, psnr        codes; structure and noise
  cielab, cielab-rms, ciede2000                   codes; colour of each pixel
  delta-e-itp, pu21-psnr, pu21-ssim               both
  flip; hdr-flip                                  codes; light
  cid, icid, icid-octave                          codes; need the table of LAB2000HL (--weights)
  cid-cielab, icid-cielab                         codes; other metrics, which need no table
  hdr-vdp; hdr-vdp-luminance                      both; light
  cvvdp                                           both
  lpips-alex, lpips-vgg, lpips-squeeze            codes; networks, which need weights (--weights)
  st-lpips-alex, st-lpips-vgg, matsim             the same

Without --metric, every metric that takes such pictures and has what it needs. Distances are 0 for identical pictures, and larger is
worse; quality is the number that the metric's authors publish, in their direction (null in JSON where it is infinite).

Examples:
  vernis compare-images reference.png test.png
  vernis compare-images reference.png test.png --metric ssim --metric flip --ppd 60 --json
  vernis compare-images reference.exr test.exr --metric cvvdp --display standard-hdr-linear
  vernis compare-images reference.png test.png --metric flip --map errors.png
  vernis compare-images reference.png test.png --metric icid --weights tables/
  vernis compare-images reference.png test.png --metric st-lpips-alex --weights weights/")]
pub struct CompareImagesArgs {
    /// The reference.
    #[arg(value_name = "REF")]
    reference: PathBuf,
    /// The picture that is tested against it.
    test: PathBuf,
    /// A metric, by name; may be given many times.
    #[arg(short, long = "metric", value_name = "NAME")]
    metrics: Vec<String>,
    /// Pixels a degree of visual angle, for flip, hdr-flip [default: 67.02] and hdr-vdp [default: 30]. cvvdp takes those of its
    /// display; cid and icid have their own, 40.
    #[arg(long, value_name = "N")]
    ppd: Option<f64>,
    /// The display of cvvdp [default: standard-fhd for codes, standard-hdr-linear for light].
    #[arg(long, value_name = "NAME", value_parser = displays())]
    display: Option<String>,
    /// Write where the differences are, as a grey PNG: black is none. Needs one --metric that has a map.
    #[arg(long, value_name = "OUT.png")]
    map: Option<PathBuf>,
    #[command(flatten)]
    replace: Replace,
    /// Print JSON: {"distances": {name: value}, "quality": {name: value}, "versions": {name: version}, "details": {name: {...}}},
    /// and with --map what is white in it.
    #[arg(long)]
    json: bool,
}

fn displays() -> PossibleValuesParser {
    PossibleValuesParser::new(Display::ALL.map(Display::name))
}

pub fn run(shared: &Shared, args: CompareImagesArgs) -> Result<()> {
    let registry = ImageRegistry::standard();
    let named =
        args.metrics.iter().map(|name| registry.get(name)).collect::<Result<Vec<_>, _>>().map_err(user_error)?;
    let named = without_repetitions(named);
    let out = args.map.as_deref().map(|map| map_file(map, &args, &named)).transpose()?;
    let display = args.display.as_deref().and_then(Display::named);
    let conditions = Conditions { ppd: args.ppd, display, ..workspace::conditions(shared)? };
    let reference = read(&args.reference).map_err(user_error)?;
    let test = read(&args.test).map_err(user_error)?;
    let found = if named.is_empty() {
        let metrics = registry.applicable(reference.encoding(), &conditions);
        let (found, left_out) = compared_where_possible(&metrics, &reference, &test, &conditions)?;
        for (name, reason) in left_out {
            super::warning(format_args!("{name} is left out: {reason}"));
        }
        found
    } else {
        compared(&named, &reference, &test, &conditions, out.is_some())?
    };
    for note in conditions.weights.iter().flat_map(|weights| weights.notes()) {
        super::warning(note);
    }
    let map = found.iter().find_map(|(_, comparison)| comparison.map.as_ref());
    if let (Some((folder, name)), Some(map)) = (&out, map) {
        folder.write(name, &png(map)?)?;
    }
    if args.json {
        return print(serde_json::to_string_pretty(&to_json(&found, map))? + "\n");
    }
    print(to_text(&found, args.map.as_deref().zip(map)))
}

type Found = Vec<(Arc<dyn ImageMetric>, Comparison)>;

/// Every metric once, in the order of their first naming.
fn without_repetitions(metrics: Vec<Arc<dyn ImageMetric>>) -> Vec<Arc<dyn ImageMetric>> {
    let mut seen = BTreeSet::new();
    metrics.into_iter().filter(|metric| seen.insert(metric.name())).collect()
}

/// What the metrics say; the first that cannot compare ends the command.
fn compared(
    metrics: &[Arc<dyn ImageMetric>],
    reference: &EncodedPicture,
    test: &EncodedPicture,
    conditions: &Conditions,
    with_map: bool,
) -> Result<Found> {
    let one = |metric: &Arc<dyn ImageMetric>| {
        let prepared = metric.prepare(reference, conditions).map_err(|error| match &error {
            ImageMetricError::NoTable { folder, .. } | ImageMetricError::NoWeights { folder, .. } => {
                let name = if folder.is_none() { "; name the folder that has it with --weights" } else { "" };
                user_error(format!("{error}{name} (`vernis data weights` says where to get it)"))
            }
            _ => user_error(error),
        })?;
        Ok((metric.clone(), prepared.compare(test, with_map).map_err(user_error)?))
    };
    metrics.iter().map(one).collect()
}

/// What the metrics say that can, where the user named none, and why others cannot.
fn compared_where_possible(
    metrics: &[Arc<dyn ImageMetric>],
    reference: &EncodedPicture,
    test: &EncodedPicture,
    conditions: &Conditions,
) -> Result<(Found, Vec<(&'static str, String)>)> {
    let mut found = Vec::new();
    let mut left_out = Vec::new();
    for metric in metrics {
        let one = metric.prepare(reference, conditions).and_then(|prepared| prepared.compare(test, false));
        match one {
            Ok(comparison) => found.push((metric.clone(), comparison)),
            // Pictures that do not go together are no pair for any metric.
            Err(error) if error.is_of_the_pair() => return Err(user_error(error)),
            Err(error) => left_out.push((metric.name(), error.to_string())),
        }
    }
    Ok((found, left_out))
}

/// The folder and name of the map, found unwritable before the work.
fn map_file(
    map: &Path,
    args: &CompareImagesArgs,
    named: &[Arc<dyn ImageMetric>],
) -> Result<(crate::report::OutputFolder, String)> {
    let [metric] = named else {
        return Err(user_error(format!("--map needs exactly one --metric; there are {}", named.len())));
    };
    if !metric.properties().has_map {
        return Err(user_error(format!("--map needs a metric with a map, and {} has none", metric.name())));
    }
    if map.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        return Err(user_error(format!("--map {} must end in .png", map.display())));
    }
    if map.is_dir() {
        return Err(user_error(format!("--map {} is a folder; it must be the name of a file", map.display())));
    }
    let inputs = Inputs::default().file(&args.reference).file(&args.test);
    output::file(map, &inputs, args.replace)
}

/// A map as a grey PNG of 16 bits.
fn png(map: &DifferenceMap) -> Result<Vec<u8>> {
    let code = |v: &f32| (v / map.white * 65535.0).clamp(0.0, 65535.0).round() as u16;
    let pixels: Vec<u16> = map.values.iter().map(code).collect();
    let (width, height) = (u32::try_from(map.width)?, u32::try_from(map.height)?);
    let picture = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width, height, pixels);
    let picture = picture.ok_or_else(|| anyhow::anyhow!("the map has another number of pixels than its size says"))?;
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageOutputFormat::Png)?;
    Ok(bytes.into_inner())
}

fn to_json(found: &Found, map: Option<&DifferenceMap>) -> Value {
    let by_name = |value: &dyn Fn(&Arc<dyn ImageMetric>, &Comparison) -> Value| -> Map<String, Value> {
        found.iter().map(|(metric, c)| (metric.name().to_owned(), value(metric, c))).collect()
    };
    let details = found.iter().filter(|(_, c)| !c.details.is_empty()).map(|(metric, c)| {
        let values = c.details.iter().map(|(name, value)| ((*name).to_owned(), json!(value)));
        (metric.name().to_owned(), Value::Object(values.collect()))
    });
    let mut all = json!({
        "distances": by_name(&|_, c| json!(c.distance)),
        "quality": by_name(&|_, c| json!(c.quality)),
        "versions": by_name(&|metric, _| json!(metric.version())),
        "details": Value::Object(details.collect()),
    });
    if let Some(map) = map {
        all["map"] = json!({"width": map.width, "height": map.height, "white": map.white});
    }
    all
}

fn to_text(found: &Found, map: Option<(&Path, &DifferenceMap)>) -> String {
    let width = found.iter().map(|(metric, _)| metric.name().len()).max().unwrap_or(0);
    let mut text = String::new();
    for (metric, c) in found {
        let properties = metric.properties();
        let (distance, quality) = (decimals(c.distance, 6), decimals(c.quality, 6));
        text += &format!(
            "{:width$}  distance {distance:<12}  {}: {quality} [{}]\n",
            metric.name(),
            properties.quality,
            properties.unit
        );
        if !c.details.is_empty() {
            let details = c.details.iter().map(|(name, value)| format!("{name} {}", decimals(*value, 6)));
            text += &format!("{:width$}    {}\n", "", details.collect::<Vec<_>>().join(", "));
        }
    }
    if let Some((path, map)) = map {
        text += &format!("{}: {} x {} pixels, white is {}\n", path.display(), map.width, map.height, map.white);
    }
    text
}
