//! `vernis render`: a BRDF in the study's scene, a scene, or the stimuli of a study.

use super::limits::{integer, seed};
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::scale::ScaleArgs;
use super::{Shared, note, print, signals, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::stimuli::{self, StimuliError, StimuliOptions};
use crate::report::OutputFolder;
use crate::samples::shard::Shard;
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::Instant;
use vernis_image::display::tone::{DEFAULT_GAMMA, Tone};
use vernis_image::picture::write;
use vernis_image::scene::file::{DEFAULT_BOUNCES, DEFAULT_SAMPLES, SceneFile, film_allowed, is_film, is_scene};
use vernis_image::scene::study::{self as study_scene, LightChoice, ShapeChoice, View};
use vernis_image::scene::{Film, Flaws, MOST_BOUNCES, MOST_SAMPLES, Reflectance, Scene, Shape};
use vernis_image::trace::Tracer;
use vernis_metric::brdf::ContentHash;
use vernis_metric::brdf::models::Lambert;
use vernis_metric::io::{counted, read_at_most};

/// Render a BRDF, a scene, or the stimuli of a study.
#[derive(Args)]
#[command(after_help = "\
A BRDF is rendered in the study's scene: the Buddha on a wooden table under Grace, 580x900, where the data folder has mesh and probe;
a folded shape and lamps made by code where it has not. A SCENE.json describes everything itself (docs/scene.schema.json); of the options
it takes --size, --samples, --bounces and --seed. People compared pictures of slightly different cameras: --camera reference is turned by
4 degrees.

An EXR file holds linear radiance, in the unit of the light. A PNG file shows it as a screen does. The paper's \"gamma value of 1.25\" may
mean two things, so --gamma is the power itself: 1/2.2 by default, that of the viewer; 0.8 is 1/1.25.

--study renders every reference, in both cameras, and every candidate of a study: MATERIAL/METHOD.exr, .png and .json in OUT. Pictures that
are there are kept; after an interruption (Ctrl-C, exit code 130; SIGTERM, 143) the same command continues.
`vernis report --study S --stimuli OUT` shows them on a page.
The same seed gives the same bytes on any number of threads.

Examples:
  vernis render merl_nbrdf.zip:gold-metallic-paint --out gold.png
  vernis render ward.json --shape blob --light lamps --size 128x200 --samples 16 --out preview.png
  vernis render scene.json --out scene.exr
  vernis render --study lavoue2021-open --out stimuli --shard 1/4")]
pub struct RenderArgs {
    /// The BRDF, as `vernis compare --help` describes, or a scene.
    #[arg(value_name = "BRDF|SCENE.json", required_unless_present = "study", conflicts_with = "study")]
    what: Option<String>,
    /// Render the stimuli of a study instead: a study by name, or a CSV file.
    #[arg(long, value_name = "NAME|CSV")]
    study: Option<String>,
    #[command(flatten)]
    scale: ScaleArgs,
    /// With --study: only every COUNT-th reference with its candidates, from the NUMBER-th on.
    #[arg(long, value_name = "NUMBER/COUNT", default_value = "1/1", requires = "study")]
    shard: Shard,
    /// File to write, .exr or .png; with --study, the folder.
    #[arg(long, short, value_name = "FILE|DIR")]
    out: PathBuf,
    /// A light probe (latitude/longitude, Radiance .hdr), `white` or `lamps` [default: Grace of the data folder, else lamps].
    #[arg(long, value_name = "HDR|white|lamps")]
    light: Option<PathBuf>,
    /// A mesh (.ply, .obj; put on the table, at most 2 high), `sphere` or `blob` [default: the Buddha of the data folder, else blob].
    #[arg(long, value_name = "MESH|sphere|blob")]
    shape: Option<PathBuf>,
    /// Leave the table out.
    #[arg(long)]
    no_table: bool,
    /// Columns and rows of the picture [default: 580x900].
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[usize; 2]>,
    /// Samples a pixel [default: 64].
    #[arg(long, value_name = "N", value_parser = integer(1..=MOST_SAMPLES))]
    samples: Option<usize>,
    /// Surface interactions of a path at most; 1 is direct light [default: 8].
    #[arg(long, value_name = "N", value_parser = integer(1..=MOST_BOUNCES))]
    bounces: Option<usize>,
    /// Seed of the random numbers [default: 0].
    #[arg(long, value_name = "N", value_parser = seed)]
    seed: Option<u64>,
    /// Which of the study's two cameras [default: test].
    #[arg(long, value_name = "VIEW")]
    camera: Option<CameraName>,
    /// Tone curve of a PNG [default: exrdisplay, the study's].
    #[arg(long, value_name = "CURVE")]
    tone: Option<ToneName>,
    /// Exposure of a PNG, f-stops.
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = exposure)]
    exposure: Option<f64>,
    /// Power of the tone curve exrdisplay [default: 0.4545, 1/2.2].
    #[arg(long, value_name = "G", value_parser = gamma)]
    gamma: Option<f64>,
    #[command(flatten)]
    replace: Replace,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CameraName {
    Reference,
    Test,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ToneName {
    Exrdisplay,
    Srgb,
    None,
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    sides.filter(|sides| is_film(*sides)).ok_or_else(|| format!("it must be WxH: {}", film_allowed()))
}

fn exposure(text: &str) -> Result<f64, String> {
    let stops = text.parse().ok().filter(|x: &f64| x.abs() <= 100.0);
    stops.ok_or_else(|| "it must be -100 to 100 f-stops".to_owned())
}

fn gamma(text: &str) -> Result<f64, String> {
    let power = text.parse().ok().filter(|x: &f64| (0.05..=10.0).contains(x));
    power.ok_or_else(|| "it must be 0.05 to 10".to_owned())
}

/// What a file is by its ending.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Exr,
    Png,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(user_error(format!("--out is {}; its name must end in .exr or .png", path.display()))),
        }
    }
}

impl RenderArgs {
    fn film(&self, of_scene: Option<Film>) -> Film {
        let [width, height] = study_scene::SIZE;
        let default = Film { width, height, samples: DEFAULT_SAMPLES, bounces: DEFAULT_BOUNCES, seed: 0 };
        let film = of_scene.unwrap_or(default);
        let [width, height] = self.size.unwrap_or([film.width, film.height]);
        Film {
            width,
            height,
            samples: self.samples.unwrap_or(film.samples),
            bounces: self.bounces.unwrap_or(film.bounces),
            seed: self.seed.unwrap_or(film.seed),
        }
    }

    fn tone(&self) -> Result<(Tone, f64)> {
        let tone = match self.tone.unwrap_or(ToneName::Exrdisplay) {
            ToneName::Exrdisplay => Tone::ExrDisplay { gamma: self.gamma.unwrap_or(DEFAULT_GAMMA) },
            other if self.gamma.is_some() => {
                let name = if other == ToneName::Srgb { "srgb" } else { "none" };
                return Err(user_error(format!("--gamma is the power of --tone exrdisplay; --tone is {name}")));
            }
            ToneName::Srgb => Tone::Srgb,
            ToneName::None => Tone::Linear,
        };
        Ok((tone, self.exposure.unwrap_or(0.0)))
    }

    fn light(&self, data: Option<&Path>) -> LightChoice {
        match self.light.as_deref().map(|path| (path, path.as_os_str().to_str())) {
            None => LightChoice::default_of(data),
            Some((_, Some("white"))) => LightChoice::White,
            Some((_, Some("lamps"))) => LightChoice::Lamps,
            Some((path, _)) => LightChoice::Probe(path.to_owned()),
        }
    }

    fn shape(&self, data: Option<&Path>) -> ShapeChoice {
        match self.shape.as_deref().map(|path| (path, path.as_os_str().to_str())) {
            None => ShapeChoice::default_of(data),
            Some((_, Some("sphere"))) => ShapeChoice::Sphere,
            Some((_, Some("blob"))) => ShapeChoice::Blob,
            Some((path, _)) => ShapeChoice::Mesh(path.to_owned()),
        }
    }

    /// The files that the options name, or that they lead to by default.
    fn inputs(&self, data: Option<&Path>) -> Inputs {
        let mut inputs = Inputs::default();
        if let LightChoice::Probe(path) = self.light(data) {
            inputs = inputs.file(path);
        }
        if let ShapeChoice::Mesh(path) = self.shape(data) {
            inputs = inputs.file(path);
        }
        inputs
    }

    /// The study's scene, but for the BRDF.
    fn study_scene(&self, data: Option<&Path>, reflectance: Reflectance) -> Result<Scene> {
        let view = if self.camera == Some(CameraName::Reference) { View::Reference } else { View::Test };
        let light = self.light(data).light().map_err(user_error)?;
        let shape = self.shape(data).shape().map_err(user_error)?;
        let mut scene = study_scene::scene(reflectance, shape, light, view, self.film(None));
        if self.no_table {
            scene.table = None;
        }
        Ok(scene)
    }

    /// The scene that `what` is, if it is one.
    fn scene_file(&self, what: &str, data: Option<&Path>) -> Result<Option<SceneFile>> {
        let path = Path::new(what);
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(OsStr::new("json")));
        if !is_json || !read_at_most(path, 1 << 20).is_ok_and(|text| is_scene(&text)) {
            return Ok(None);
        }
        let given = [
            ("--light", self.light.is_some()),
            ("--shape", self.shape.is_some()),
            ("--no-table", self.no_table),
            ("--camera", self.camera.is_some()),
        ];
        if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
            return Err(user_error(format!("{what} is a scene, which says that itself; {option} is for BRDFs")));
        }
        SceneFile::read(path, data).map(Some).map_err(user_error)
    }
}

pub fn run(shared: &Shared, args: RenderArgs) -> Result<()> {
    match (&args.what, &args.study) {
        (Some(what), _) => picture(shared, &args, what),
        (None, Some(name)) => of_study(shared, &args, name),
        // clap asks for one of them.
        (None, None) => Err(user_error("nothing to render is named; name a BRDF, a scene or a --study")),
    }
}

fn picture(shared: &Shared, args: &RenderArgs, what: &str) -> Result<()> {
    let data = shared.data.as_deref();
    let format = Format::of(&args.out)?;
    let (tone, exposure) = args.tone()?;
    if format == Format::Exr
        && (args.tone.is_some_and(|t| t != ToneName::None) || args.exposure.is_some() || args.gamma.is_some())
    {
        return Err(user_error("an EXR file holds linear radiance; --tone, --exposure and --gamma are for PNG files"));
    }
    let (scene, inputs) = match args.scene_file(what, data)? {
        Some(SceneFile { mut scene, files }) => {
            scene.film = args.film(Some(scene.film));
            (Some(scene), Inputs::default().files(files))
        }
        None => (None, args.inputs(data).notation(what, data)),
    };
    let (folder, name) = output::file(&args.out, &inputs, args.replace)?;
    let scene = match scene {
        Some(scene) => scene,
        None => {
            let open = workspace::open(what, data)?;
            args.study_scene(data, Reflectance::Brdf(open.brdf, open.content))?
        }
    };
    say_flaws(&scene);
    let tracer = Tracer::new(&scene).map_err(|e| user_error(format!("{what}: {e}")))?;
    if let Some(tabulation) = tracer.tabulation() {
        note(format_args!(
            "{what}: tabulated; its luminance is off by {:.3} % on average, {:+.3} % in all",
            100.0 * tabulation.mean_error,
            100.0 * tabulation.bias
        ));
    }
    let bar = Bar::new();
    let started = Instant::now();
    let found = tracer.render(&|stage, progress| bar.update(stage, progress));
    let seconds = started.elapsed().as_secs_f64();
    bar.finish();
    let picture = found.map_err(|e| user_error(format!("{what}: {e}")))?;
    let bytes = match format {
        Format::Exr => picture.to_exr()?,
        Format::Png => write::to_png(picture.width(), picture.height(), &tone.apply(&picture, exposure))?,
    };
    folder.write(&name, &bytes)?;
    let Film { width, height, samples, bounces, .. } = scene.film;
    print(format!(
        "{width}x{height} pixels, {}, {}, {seconds:.2} s, {:.2} million rays a second: {}\n",
        counted(samples, "sample"),
        counted(bounces, "bounce"),
        tracer.rays() as f64 / 1e6 / seconds.max(1e-9),
        args.out.display()
    ))
}

/// Says what is unusual about the mesh.
fn say_flaws(scene: &Scene) {
    let Shape::Mesh(mesh) = &scene.shape else { return };
    let Flaws { without_area, crowded_edges, .. } = mesh.flaws();
    if without_area > 0 {
        note(format_args!("the mesh has {} without area; they are left out", counted(without_area, "face")));
    }
    if crowded_edges > 0 {
        note(format_args!(
            "the mesh is no manifold: {} belong to more than two faces; it is rendered as it is",
            counted(crowded_edges, "edge")
        ));
    }
}

fn of_study(shared: &Shared, args: &RenderArgs, name: &str) -> Result<()> {
    let data = shared.data.as_deref();
    if args.camera.is_some() {
        return Err(user_error("--study uses both cameras; --camera is for single pictures"));
    }
    let tone = args.tone()?;
    let study = Study::load_on(name, data, args.scale.declared).map_err(user_error)?;
    let sources = study.pairs.iter().flat_map(|pair| [&pair.reference, &pair.candidate]);
    let inputs = args.inputs(data).file(name).sources(sources, data);
    let names: Vec<String> = stimuli::stimuli(&study, args.shard)
        .iter()
        .flat_map(|stimulus| ["exr", "png", "json"].map(|ending| format!("{}.{ending}", stimulus.name)))
        .collect();
    let folder: OutputFolder = output::folder(Some(&args.out), PathBuf::new, &names, &inputs, Replace::CONTINUES)?;
    let black = Reflectance::Brdf(std::sync::Arc::new(Lambert { kd: [0.0; 3] }), ContentHash([0; 32]));
    let options = StimuliOptions {
        data: shared.data.clone(),
        folder: folder.path().to_owned(),
        shard: args.shard,
        scene: args.study_scene(data, black)?,
        tone,
    };
    say_flaws(&options.scene);
    let bar = Bar::new();
    let kept = format!("the pictures that are finished are in {}; the same command continues", args.out.display());
    signals::resumable(&bar, kept)?;
    let found = stimuli::render(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let made = found.map_err(|error| match error {
        StimuliError::Brdf(_) | StimuliError::Trace { .. } => user_error(error),
        other => anyhow::Error::new(other),
    })?;
    let synthetic = if study.synthetic { " (SYNTHETIC ratings)" } else { "" };
    print(format!(
        "{}{synthetic}: {} made, {} kept: {}\n",
        study.name,
        counted(made.made, "picture"),
        made.kept,
        args.out.display()
    ))
}
