//! A scene as a JSON file.
//!
//! ```json
//! {"shape": {"mesh": "buddha.ply", "translate": [0, -0.05, 0], "scale": 10, "normals": "smooth"},
//!  "brdf": {"model": "ggx", "kd": [0.2, 0.1, 0.1], "f0": [0.1, 0.1, 0.1], "alpha": 0.3},
//!  "table": {"half_side": 3, "brdf": "wood"},
//!  "camera": {"from": [0, 1, 6], "to": [0, 1, 0], "fov_deg": 24},
//!  "film": [580, 900], "light": "grace_probe_latlong.hdr", "light_scale": 1, "bounces": 8, "samples": 64, "seed": 0, "background": false}
//! ```
//!
//! `shape`: `"sphere"` (radius 1 at the origin), `{"sphere": {"radius": r, "center": [x, y, z]}}`, `"blob"` ([`super::blob`]), or a mesh, which is
//! moved first and scaled then. `brdf`: the notation of sources, or a model as its own file has it; `"wood"` for a table.
//! `light`: `"white"`, `"lamps"`, or a light probe. `fov_deg` is the full vertical angle. Paths are relative to the file; BRDFs, meshes and
//! probes are looked for in the data folder as well. `docs/scene.schema.json` is the schema of this file.

use super::mesh::Normals;
use super::{
    Camera, Film, Light, MOST_BOUNCES, MOST_PIXELS, MOST_PIXELS_A_SIDE, MOST_SAMPLES, Mesh, Panorama, Reflectance,
    Scene, SceneError, Shape, Table, Wood, blob,
};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::brdf::formats::model_json;
use vernis_metric::io::{read_at_most, unique_keys};

/// Far more than a scene needs.
const MOST_BYTES: u64 = 1 << 20;
/// Where nothing is said: bounces and samples.
pub const DEFAULT_BOUNCES: usize = 8;
/// Samples a pixel where nothing is said.
pub const DEFAULT_SAMPLES: usize = 64;
/// Folders of the data folder in which meshes and light probes are looked for as well.
const SUBFOLDERS: [&str; 2] = ["meshes", "envmaps"];

/// A scene, and the files that it was made from.
pub struct SceneFile {
    /// The scene.
    pub scene: Scene,
    /// The file itself, and those that it names.
    pub files: Vec<PathBuf>,
}

/// Whether JSON is a scene rather than a model: it has no `model`.
pub fn is_scene(text: &[u8]) -> bool {
    matches!(serde_json::from_slice(text), Ok(Value::Object(object)) if !object.contains_key("model"))
}

impl SceneFile {
    /// Reads a scene and everything that it names.
    ///
    /// # Errors
    /// The file, the key, what was found and what is allowed; or what is wrong with a file that it names.
    pub fn read(path: &Path, data: Option<&Path>) -> Result<Self, SceneError> {
        let io = |cause| SceneError::Io { path: path.to_owned(), cause };
        let text = read_at_most(path, MOST_BYTES).map_err(io)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut found = Self::parse(path, &text, folder, data)?;
        found.files.push(path.to_owned());
        Ok(found)
    }

    /// A scene in `text`; `path` is for messages, and what the scene names is in `folder` or in the data folder.
    ///
    /// # Errors
    /// Those of [`SceneFile::read`].
    pub fn parse(path: &Path, text: &[u8], folder: &Path, data: Option<&Path>) -> Result<Self, SceneError> {
        let json = |reason: String| SceneError::Json { path: path.to_owned(), reason };
        let value = unique_keys(text).map_err(|e| json(e.to_string()))?;
        let mut reader = Reader { place: path.display().to_string(), folder, data, files: Vec::new() };
        let scene = reader.scene(&value)?;
        Ok(Self { scene, files: reader.files })
    }
}

/// An object of the file, and the key that leads to it.
struct Object<'a> {
    place: &'a str,
    key: String,
    fields: &'a Map<String, Value>,
}

impl<'a> Object<'a> {
    fn new(place: &'a str, key: &str, value: &'a Value, keys: &[&str]) -> Result<Self, SceneError> {
        let Value::Object(fields) = value else {
            let name = if key.is_empty() { "the scene" } else { key };
            return Err(wrong(place, name, Some(value), &format!("an object with {}", keys.join(", "))));
        };
        if let Some(unknown) = fields.keys().find(|k| !keys.contains(&k.as_str())) {
            let found = if key.is_empty() { unknown.clone() } else { format!("{key}.{unknown}") };
            return Err(SceneError::UnknownKey { place: place.to_owned(), found, allowed: keys.join(", ") });
        }
        Ok(Self { place, key: key.to_owned(), fields })
    }

    fn name(&self, key: &str) -> String {
        if self.key.is_empty() { key.to_owned() } else { format!("{}.{key}", self.key) }
    }

    fn get(&self, key: &str) -> Option<&'a Value> {
        self.fields.get(key)
    }

    fn wrong(&self, key: &str, allowed: &str) -> SceneError {
        wrong(self.place, &self.name(key), self.get(key), allowed)
    }

    /// A number that `fits`; `None` where the key is absent.
    fn number(&self, key: &str, allowed: &str, fits: impl Fn(f64) -> bool) -> Result<Option<f64>, SceneError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let number = value.as_f64().filter(|x| x.is_finite() && fits(*x));
        number.map(Some).ok_or_else(|| self.wrong(key, allowed))
    }

    fn integer(&self, key: &str, least: u64, most: u64, default: u64) -> Result<u64, SceneError> {
        let Some(value) = self.get(key) else { return Ok(default) };
        let number = value.as_u64().filter(|n| (least..=most).contains(n));
        number.ok_or_else(|| self.wrong(key, &format!("an integer from {least} to {most}")))
    }

    fn point(&self, key: &str) -> Result<Option<[f64; 3]>, SceneError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = value.as_array().map(|items| items.iter().filter_map(Value::as_f64).collect());
        let point = numbers.filter(|n| n.iter().all(|x| x.abs() <= 1e6)).and_then(|n| <[f64; 3]>::try_from(n).ok());
        let complete = value.as_array().is_some_and(|items| items.len() == 3);
        point.filter(|_| complete).map(Some).ok_or_else(|| self.wrong(key, "three numbers from -1e6 to 1e6"))
    }
}

fn wrong(place: &str, field: &str, found: Option<&Value>, allowed: &str) -> SceneError {
    SceneError::Field {
        place: place.to_owned(),
        field: field.to_owned(),
        found: found.map_or("missing".to_owned(), Value::to_string),
        allowed: allowed.to_owned(),
    }
}

struct Reader<'a> {
    place: String,
    folder: &'a Path,
    data: Option<&'a Path>,
    files: Vec<PathBuf>,
}

const KEYS: [&str; 11] =
    ["shape", "brdf", "table", "camera", "film", "light", "light_scale", "bounces", "samples", "seed", "background"];
const SHAPES: &str = r#""sphere", "blob", {"sphere": {"radius": ...}} or {"mesh": PATH, ...}"#;
const BRDFS: &str =
    "a BRDF in the source notation or a model such as {\"model\": \"lambert\", \"kd\": [0.5, 0.5, 0.5]}";

impl Reader<'_> {
    fn scene(&mut self, value: &Value) -> Result<Scene, SceneError> {
        let place = self.place.clone();
        let scene = Object::new(&place, "", value, &KEYS)?;
        if let Some(key) = ["shape", "brdf", "camera", "film", "light"].into_iter().find(|key| scene.get(key).is_none())
        {
            let allowed = match key {
                "shape" => SHAPES,
                "brdf" => BRDFS,
                "camera" => r#"{"from": [x, y, z], "to": [x, y, z], "fov_deg": degrees}"#,
                "film" => "[width, height]",
                _ => LIGHTS,
            };
            return Err(scene.wrong(key, allowed));
        }
        let background = match scene.get("background") {
            None => false,
            Some(Value::Bool(background)) => *background,
            Some(_) => return Err(scene.wrong("background", "true or false")),
        };
        let [width, height] = film(&scene)?;
        let film = Film {
            width,
            height,
            samples: scene.integer("samples", 1, MOST_SAMPLES as u64, DEFAULT_SAMPLES as u64)? as usize,
            bounces: scene.integer("bounces", 1, MOST_BOUNCES as u64, DEFAULT_BOUNCES as u64)? as usize,
            seed: scene.integer("seed", 0, u64::MAX, 0)?,
        };
        let camera = camera(&scene)?;
        let light_scale = scene.number("light_scale", "more than 0 and at most 1e6", |x| x > 0.0 && x <= 1e6)?;
        // What takes time comes last.
        Ok(Scene {
            reflectance: self.brdf("brdf", scene.get("brdf"))?,
            table: self.table(&scene)?,
            light: self.light(&scene)?,
            shape: self.shape(&scene)?,
            light_scale: light_scale.unwrap_or(1.0),
            camera,
            background,
            film,
        })
    }

    /// The first place where a file is: beside the scene, then in the data folder.
    fn find(&mut self, field: &str, name: &str) -> Result<PathBuf, SceneError> {
        let mut tried = vec![self.folder.join(name)];
        if let Some(data) = self.data {
            tried.push(data.join(name));
            tried.extend(SUBFOLDERS.iter().map(|folder| data.join(folder).join(name)));
        }
        match tried.iter().find(|path| path.exists()) {
            Some(path) => {
                self.files.push(path.clone());
                Ok(path.clone())
            }
            None => {
                let tried = tried.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
                Err(wrong(
                    &self.place,
                    field,
                    Some(&Value::from(name)),
                    &format!("a file that is there; looked for {tried}"),
                ))
            }
        }
    }

    fn brdf(&mut self, key: &str, value: Option<&Value>) -> Result<Reflectance, SceneError> {
        match value {
            Some(Value::String(notation)) => {
                let beside = self.folder.join(notation).to_string_lossy().into_owned();
                let source = |notation: &str| BrdfSource::parse(notation);
                let source = match source(&beside) {
                    Ok(found) if found.locate(None).is_ok() => found,
                    _ => source(notation)?,
                };
                self.files.extend(source.locate(self.data)?);
                let open = source.open(self.data)?;
                Ok(Reflectance::Brdf(open.brdf, open.content))
            }
            Some(object @ Value::Object(_)) => {
                let open = model_json::from_value(&format!("{}: {key}", self.place), object)?;
                Ok(Reflectance::Brdf(open.brdf, open.content))
            }
            other => Err(wrong(&self.place, key, other, BRDFS)),
        }
    }

    fn table(&mut self, scene: &Object) -> Result<Option<Table>, SceneError> {
        let value = match scene.get("table") {
            None | Some(Value::Null) => return Ok(None),
            Some(value) => value,
        };
        let table = Object::new(scene.place, "table", value, &["half_side", "brdf"])?;
        let allowed = "more than 0 and at most 1e6";
        let half_side = table.number("half_side", allowed, |x| x > 0.0 && x <= 1e6)?;
        let half_side = half_side.ok_or_else(|| table.wrong("half_side", allowed))?;
        let reflectance = match table.get("brdf") {
            Some(Value::String(wood)) if wood == "wood" => Reflectance::Wood(Wood),
            other => self.brdf("table.brdf", other)?,
        };
        Ok(Some(Table { half_side, reflectance }))
    }

    fn light(&mut self, scene: &Object) -> Result<Light, SceneError> {
        match scene.get("light").and_then(Value::as_str) {
            Some("white") => Ok(Light::White),
            Some("lamps") => Ok(Light::Panorama(Arc::new(Panorama::lamps()))),
            Some(path) => Ok(Light::Panorama(Arc::new(Panorama::read(&self.find("light", path)?)?))),
            None => Err(scene.wrong("light", LIGHTS)),
        }
    }

    fn shape(&mut self, scene: &Object) -> Result<Shape, SceneError> {
        let sphere = |center, radius| Shape::Sphere { center, radius };
        let fields = match scene.get("shape") {
            Some(Value::String(name)) if name == "sphere" => return Ok(sphere([0.0; 3], 1.0)),
            Some(Value::String(name)) if name == "blob" => return Ok(Shape::Mesh(Arc::new(blob()))),
            Some(value @ Value::Object(fields)) => (value, fields),
            _ => return Err(scene.wrong("shape", SHAPES)),
        };
        if let Some(value) = fields.1.get("sphere") {
            Object::new(scene.place, "shape", fields.0, &["sphere"])?;
            let object = Object::new(scene.place, "shape.sphere", value, &["radius", "center"])?;
            let allowed = "more than 0 and at most 1e6";
            let radius = object.number("radius", allowed, |x| x > 0.0 && x <= 1e6)?;
            let radius = radius.ok_or_else(|| object.wrong("radius", allowed))?;
            return Ok(sphere(object.point("center")?.unwrap_or_default(), radius));
        }
        let object = Object::new(scene.place, "shape", fields.0, &["mesh", "translate", "scale", "normals"])?;
        let Some(path) = object.get("mesh").and_then(Value::as_str) else {
            return Err(object.wrong("mesh", "the path of a PLY or OBJ file"));
        };
        let normals = match object.get("normals").map(Value::as_str) {
            None | Some(Some("face")) => Normals::Face,
            Some(Some("smooth")) => Normals::Smooth,
            Some(_) => return Err(object.wrong("normals", r#""face" or "smooth""#)),
        };
        let translate = object.point("translate")?.unwrap_or_default();
        let scale = object.number("scale", "more than 0 and at most 1e6", |x| x > 0.0 && x <= 1e6)?.unwrap_or(1.0);
        let mesh = Mesh::read(&self.find("shape.mesh", path)?, normals)?;
        Ok(Shape::Mesh(Arc::new(mesh.placed(translate, scale))))
    }
}

const LIGHTS: &str = r#""white", "lamps" or the path of a light probe (Radiance .hdr)"#;

fn film(scene: &Object) -> Result<[usize; 2], SceneError> {
    let sides: Option<Vec<usize>> = scene
        .get("film")
        .and_then(Value::as_array)
        .map(|items| items.iter().filter_map(|n| usize::try_from(n.as_u64()?).ok()).collect());
    let complete = scene.get("film").and_then(Value::as_array).is_some_and(|items| items.len() == 2);
    let sides = sides.filter(|_| complete).and_then(|sides| <[usize; 2]>::try_from(sides).ok());
    sides.filter(|sides| is_film(*sides)).ok_or_else(|| scene.wrong("film", &film_allowed()))
}

/// Whether a film can have these sides, pixels.
pub fn is_film([width, height]: [usize; 2]) -> bool {
    let side = 1..=MOST_PIXELS_A_SIDE;
    side.contains(&width) && side.contains(&height) && width * height <= MOST_PIXELS
}

/// What films are allowed.
pub fn film_allowed() -> String {
    format!("width and height, 1 to {MOST_PIXELS_A_SIDE} pixels each and at most {MOST_PIXELS} in all")
}

fn camera(scene: &Object) -> Result<Camera, SceneError> {
    let value = scene.get("camera").unwrap_or(&Value::Null);
    let object = Object::new(scene.place, "camera", value, &["from", "to", "fov_deg"])?;
    let point = |key: &str| object.point(key)?.ok_or_else(|| object.wrong(key, "three numbers"));
    let fov = object.number("fov_deg", "0.01 to 179 degrees", |x| (0.01..=179.0).contains(&x))?;
    let camera = Camera {
        from: point("from")?,
        to: point("to")?,
        fov_deg: fov.ok_or_else(|| object.wrong("fov_deg", "0.01 to 179 degrees"))?,
    };
    match camera.flaw() {
        None => Ok(camera),
        Some((field, found, allowed)) => Err(SceneError::Field {
            place: scene.place.to_owned(),
            field: field.to_owned(),
            found,
            allowed: allowed.to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = r#"{"shape": {"mesh": "a.obj", "translate": [1, 0, 0], "scale": 2, "normals": "smooth"},
        "brdf": {"model": "lambert", "kd": [0.5, 0.5, 0.5]}, "table": {"half_side": 3, "brdf": "wood"},
        "camera": {"from": [0, 1, 6], "to": [0, 1, 0], "fov_deg": 24}, "film": [58, 90], "light": "lamps", "light_scale": 0.5,
        "bounces": 3, "samples": 7, "seed": 18446744073709551615, "background": true}"#;

    fn read(text: &str) -> Result<Scene, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        std::fs::write(folder.path().join("b.json"), r#"{"model": "lambert", "kd": [0.1, 0.2, 0.3]}"#).unwrap();
        std::fs::write(folder.path().join("x.hdr"), "no picture").unwrap();
        let path = folder.path().join("scene.json");
        std::fs::write(&path, text).unwrap();
        SceneFile::read(&path, None).map(|found| found.scene).map_err(|e| e.to_string())
    }

    #[test]
    fn everything_is_read() {
        let scene = read(WHOLE).unwrap();
        assert_eq!(scene.film, Film { width: 58, height: 90, samples: 7, bounces: 3, seed: u64::MAX });
        assert!(scene.background && scene.light_scale == 0.5);
        let Shape::Mesh(mesh) = scene.shape else { panic!("a mesh") };
        // Moved first, scaled then.
        assert_eq!(mesh.bounds().0[0], 2.0);
        assert!(mesh.corner_normals(0).is_some());
        assert!(matches!(scene.table.unwrap().reflectance, Reflectance::Wood(_)));
        let notation = read(&WHOLE.replace(r#"{"model": "lambert", "kd": [0.5, 0.5, 0.5]}"#, r#""b.json""#)).unwrap();
        assert!(matches!(notation.reflectance, Reflectance::Brdf(..)));
        let least = r#"{"shape": "sphere", "brdf": "b.json", "camera": {"from": [0, 0, 5], "to": [0, 0, 0], "fov_deg": 30}, "film": [4, 4], "light": "white"}"#;
        let scene = read(least).unwrap();
        assert_eq!((scene.film.samples, scene.film.bounces, scene.film.seed), (DEFAULT_SAMPLES, DEFAULT_BOUNCES, 0));
        assert!(scene.table.is_none() && !scene.background);
    }

    #[test]
    fn what_is_wrong_is_said_with_file_key_and_what_is_allowed() {
        for (from, to, expected) in [
            (r#""film": [58, 90]"#, r#""film": [0, 90]"#, "film is [0,90]; it must be width and height, 1 to 16384"),
            (r#""film": [58, 90]"#, r#""film": [16384, 16384]"#, "film is [16384,16384]"),
            (r#""film": [58, 90]"#, r#""film": [58, 90, "x"]"#, "film is"),
            (r#""samples": 7"#, r#""samples": 0"#, "samples is 0; it must be an integer from 1 to"),
            (r#""samples": 7"#, r#""samples": 1.5"#, "samples is 1.5"),
            (r#""bounces": 3"#, r#""bounces": 0"#, "bounces is 0"),
            (r#""seed": 18446744073709551615"#, r#""seed": -1"#, "seed is -1"),
            (r#""lamps""#, r#""nowhere.hdr""#, "light is \"nowhere.hdr\"; it must be a file that is there; looked for"),
            (r#""lamps""#, r#""x.hdr""#, "x.hdr: light probe: "),
            (r#""lamps""#, "3", r#"light is 3; it must be "white", "lamps" or"#),
            (r#""light_scale": 0.5"#, r#""light_scale": 0"#, "light_scale is 0; it must be more than 0"),
            (r#""background": true"#, r#""background": 1"#, "background is 1; it must be true or false"),
            (r#""half_side": 3"#, r#""half_side": -3"#, "table.half_side is -3"),
            (r#""half_side": 3, "#, "", "table.half_side is missing"),
            (r#""brdf": "wood""#, r#""brdf": "stone""#, "`stone` is not a BRDF source"),
            (r#""fov_deg": 24"#, r#""fov_deg": 180"#, "camera.fov_deg is 180; it must be 0.01 to 179"),
            (r#""to": [0, 1, 0]"#, r#""to": [0, 1, 6]"#, "camera.to is where camera.from is"),
            (r#""from": [0, 1, 6]"#, r#""from": [0, 1]"#, "camera.from is [0,1]; it must be three numbers"),
            (r#""from": [0, 1, 6]"#, r#""from": [0, 1, 6, "x"]"#, "camera.from is"),
            (r#""scale": 2"#, r#""scale": 0"#, "shape.scale is 0"),
            (
                r#""normals": "smooth""#,
                r#""normals": "round""#,
                r#"shape.normals is "round"; it must be "face" or "smooth""#,
            ),
            ("a.obj", "b.obj", "shape.mesh is \"b.obj\""),
            (r#""mesh": "a.obj", "#, "", "shape.mesh is missing"),
            (r#""kd": [0.5, 0.5, 0.5]"#, r#""kd": [0.5, 0.5, 1.5]"#, "kd.b is 1.5; it must be 0 to 1"),
            (r#""kd": [0.5, 0.5, 0.5]"#, r#""ks": 1"#, "brdf: lambert has no parameter `ks`"),
            (r#""seed""#, r#""sead""#, "there is no key sead here; the keys are shape, brdf"),
            (r#""to": ["#, r#""two": 1, "to": ["#, "there is no key camera.two here; the keys are from, to, fov_deg"),
            (r#""seed""#, r#""samples": 1, "seed""#, "the key `samples` is given twice"),
            (r#""background": true}"#, "", "not a scene in JSON"),
        ] {
            assert!(WHOLE.contains(from), "{from}");
            let message = read(&WHOLE.replacen(from, to, 1)).err().unwrap_or_default();
            assert!(message.contains(expected), "{to}: {message}");
        }
        assert!(read("[1]").unwrap_err().contains("is [1]; it must be an object with shape"));
        assert!(read("{}").unwrap_err().contains("shape is missing"));
    }

    #[test]
    fn models_and_scenes_are_told_apart() {
        assert!(is_scene(WHOLE.as_bytes()));
        assert!(!is_scene(br#"{"model": "lambert"}"#) && !is_scene(b"no JSON"));
    }
}
