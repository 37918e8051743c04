//! LPIPS, ST-LPIPS and MatSim: their values beside PyTorch's, and what they say of wrong weights.
//!
//! Origin of values: `experiments/peers/networks.py` (PyTorch 2.15, networks and linear layers with weights by formula) for pictures by
//! formula; `image_golden.json` in the reference folder beside the data folder for its pictures (packages `stlpips-pytorch` 0.0.2 with
//! its own weights, `lpips` 0.1.4 with its own linear layers on networks by formula, and MatSim's network by formula). Published
//! weights are looked for in the folder VERNIS_WEIGHTS.

mod formula;

use crate::data_folder;
use formula::Tensor;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use tempfile::TempDir;
use vernis_image::metric::{Comparison, Conditions, ImageMetricError, ImageRegistry, WEIGHTS_FILES, Weights};
use vernis_image::picture::read::read;
use vernis_image::picture::{EncodedPicture, Encoding};

// So that a change of the variable makes the tests anew.
const _: Option<&str> = option_env!("VERNIS_WEIGHTS");

/// The names of networks by formula, as safetensors files.
const ALEX: &str = "alexnet-owt-7be5be79.safetensors";
const VGG: &str = "vgg16-397923af.safetensors";
const SQUEEZE: &str = "squeezenet1_1-b8a52dc0.safetensors";

/// A folder with all networks by formula, linear layers too.
static FORMULA: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, tensors: Vec<Tensor>| formula::write(&folder.path().join(name), &tensors);
    write("alex.safetensors", formula::linear(&[64, 192, 384, 256, 256]));
    write("vgg.safetensors", formula::linear(&[64, 128, 256, 512, 512]));
    write("squeeze.safetensors", formula::linear(&[64, 128, 256, 384, 384, 512, 512]));
    write(ALEX, formula::alexnet());
    write(VGG, formula::vgg16());
    write(SQUEEZE, formula::squeezenet());
    write("alex_shift_tolerant.safetensors", formula::shift_tolerant_alex());
    write("vgg_shift_tolerant.safetensors", formula::shift_tolerant_vgg());
    write("model_best.safetensors", formula::matsim());
    folder
});

fn conditions(folder: &Path) -> Conditions {
    Conditions { weights: Some(Arc::new(Weights::in_folder(folder).expect("a folder"))), ..Conditions::default() }
}

/// The pictures of `networks.py`: ramps, a chess board and texture; the same with noise.
fn pictures(width: usize, height: usize) -> [EncodedPicture; 2] {
    let code = |x: usize, y: usize, c: usize| {
        (20 + (3 * x + 2 * (c + 1) * y) % 150 + 60 * ((x / 16 + y / 16) % 2) + (x * x + 7 * y * (c + 1)) % 23) as f32
    };
    let noise =
        |x: usize, y: usize, c: usize| ((x * 7919 + y * 104_729 + c * 1_299_709 + x * y * 31) % 29) as f32 - 14.0;
    let picture = |value: &dyn Fn(usize, usize, usize) -> f32| {
        let pixel = |i: usize| std::array::from_fn(|c| value(i % width, i / width, c));
        let pixels = (0..width * height).map(pixel).collect();
        EncodedPicture::new(width, height, pixels, Encoding::Srgb).expect("a picture")
    };
    [picture(&code), picture(&|x, y, c| (code(x, y, c) + noise(x, y, c)).clamp(0.0, 255.0))]
}

fn compared(metric: &str, pair: &[EncodedPicture; 2], conditions: &Conditions, with_map: bool) -> Comparison {
    let metric = ImageRegistry::standard().get(metric).expect("a metric");
    metric.prepare(&pair[0], conditions).expect("a reference").compare(&pair[1], with_map).expect("a pair")
}

/// Metric, and the share of each layer by PyTorch.
const LAYERS: &[(&str, &[f64])] = &[
    (
        "lpips-alex",
        &[
            0.003646749770268798,
            0.000803187198471278,
            0.0002938776451628655,
            0.0003102883929386735,
            0.0003221570805180818,
        ],
    ),
    (
        "lpips-vgg",
        &[
            0.004922429099678993,
            0.001429297379218042,
            0.00046259010559879243,
            0.00021471774380188435,
            0.00016694872465450317,
        ],
    ),
    (
        "lpips-squeeze",
        &[
            0.005306382663547993,
            0.0029832555446773767,
            0.0011045889696106315,
            0.0007609677850268781,
            0.0008272117120213807,
            0.0006228277343325317,
            0.00047828807146288455,
        ],
    ),
    (
        "st-lpips-alex",
        &[
            0.0005955816595815122,
            9.346939623355865e-05,
            2.1943002138868906e-05,
            2.3028731447993778e-05,
            2.479639988450799e-05,
        ],
    ),
    (
        "st-lpips-vgg",
        &[
            0.004922429099678993,
            0.0005675717839039862,
            9.366253652842715e-05,
            2.372696872043889e-05,
            8.706247172085568e-06,
        ],
    ),
];

#[test]
fn every_layer_agrees_with_pytorch() {
    let conditions = conditions(FORMULA.path());
    let pair = pictures(67, 51);
    for (metric, expected) in LAYERS {
        let found = compared(metric, &pair, &conditions, true);
        assert_eq!(found.details.len(), expected.len(), "{metric}");
        for ((layer, value), expected) in found.details.iter().zip(*expected) {
            let off = (value / expected - 1.0).abs();
            assert!(off < 2e-5, "{metric}, {layer}: {value} is {off:e} from {expected}");
        }
        let sum: f64 = found.details.iter().map(|(_, v)| v).sum();
        assert_eq!((found.distance, found.quality), (sum, sum));
        // Enlarging keeps the mean of a map but for its edges.
        let map = found.map.expect("a map");
        assert_eq!((map.width, map.height, map.values.len()), (67, 51, 67 * 51));
        let mean = map.values.iter().map(|v| f64::from(*v)).sum::<f64>() / map.values.len() as f64;
        assert!((mean / sum - 1.0).abs() < 0.1 && map.values.iter().all(|v| *v >= 0.0), "{metric}: {mean} {sum}");
    }
}

#[test]
fn matsim_agrees_with_pytorch() {
    let found = compared("matsim", &pictures(67, 51), &conditions(FORMULA.path()), true);
    let off = (found.distance - 37.96089346452361).abs();
    assert!(off < 1e-9, "{} is {off:e} off", found.distance);
    assert!(found.map.is_none());
}

#[test]
fn identical_pictures_are_at_zero_and_threads_change_nothing() {
    let conditions = conditions(FORMULA.path());
    let [reference, test] = pictures(67, 51);
    for metric in ["lpips-alex", "lpips-vgg", "lpips-squeeze", "st-lpips-alex", "st-lpips-vgg", "matsim"] {
        let metric = ImageRegistry::standard().get(metric).expect("a metric");
        let prepared = metric.prepare(&reference, &conditions).expect("a reference");
        let same = prepared.compare(&reference, true).expect("a pair");
        assert_eq!((same.distance, same.quality), (0.0, 0.0), "{}", metric.name());
        assert!(same.map.is_none_or(|map| map.values.iter().all(|v| *v == 0.0)));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let run = || metric.prepare(&reference, &conditions).expect("a reference").distance(&test).expect("a pair");
            pool.install(run).to_bits()
        };
        assert_eq!(on(1), on(3), "{}", metric.name());
    }
}

/// Pictures of the reference folder.
fn reference_pair(pair: &str) -> [EncodedPicture; 2] {
    let folder = data_folder().join("../reference/images");
    ["ref", "test"].map(|which| read(&folder.join(format!("{pair}_{which}.png"))).expect("a picture"))
}

const PAIRS: [&str; 5] = ["ldr01_noise", "ldr02_rough", "ldr04_gamma", "ldr06_same", "ldr09_large"];

/// What differs from PyTorch by more than `tolerance` times its value.
fn misses(metric: &str, expected: [f64; 5], conditions: &Conditions, tolerance: f64) -> Vec<String> {
    let one = |(pair, expected): (&str, f64)| {
        let found = compared(metric, &reference_pair(pair), conditions, false).quality;
        let far = (found - expected).abs() > tolerance * expected;
        println!("{metric} {pair}: {found} is {:e} from {expected}", found - expected);
        far.then(|| format!("{metric} of {pair}: {found} is {:e} from {expected}", found - expected))
    };
    PAIRS.into_iter().zip(expected).filter_map(one).collect()
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn matsim_agrees_on_reference_pictures() {
    let expected = [165.7193145751953, 70.39712524414062, 234.04075622558594, 0.0, 94.45689392089844];
    // PyTorch computed these in 32 bits, ours are in 64. Its own value of `ldr01_noise` in 64 bits is 165.71956616262, as ours.
    let missed = misses("matsim", expected, &conditions(FORMULA.path()), 2e-6);
    assert!(missed.is_empty(), "{missed:#?}");
}

fn published() -> PathBuf {
    PathBuf::from(std::env::var_os("VERNIS_WEIGHTS").expect("VERNIS_WEIGHTS names the folder of weights"))
}

#[test_with::env(VERNIS_DATA, VERNIS_WEIGHTS)]
#[test]
fn st_lpips_agrees_on_reference_pictures_with_its_own_weights() {
    let conditions = conditions(&published());
    let alex = [0.41943997144699097, 0.027186773717403412, 0.035153571516275406, 0.0, 0.037176068872213364];
    let vgg = [0.3775354325771332, 0.026224441826343536, 0.021450988948345184, 0.0, 0.07143203914165497];
    let missed =
        [misses("st-lpips-alex", alex, &conditions, 2e-6), misses("st-lpips-vgg", vgg, &conditions, 2e-6)].concat();
    assert!(missed.is_empty(), "{missed:#?}");
    let notes = conditions.weights.as_ref().map(|weights| weights.notes());
    assert_eq!(notes, Some(vec![]), "these are the published files");
}

#[test_with::env(VERNIS_DATA, VERNIS_WEIGHTS)]
#[test]
fn lpips_agrees_on_reference_pictures_with_its_own_linear_layers() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["alex.pth", "vgg.pth", "squeeze.pth"] {
        fs::copy(published().join(name), folder.path().join(name)).expect("copied");
    }
    for name in [ALEX, VGG, SQUEEZE] {
        fs::copy(FORMULA.path().join(name), folder.path().join(name)).expect("copied");
    }
    let conditions = conditions(folder.path());
    let alex = [0.011914050206542015, 0.0031089726835489273, 0.044660232961177826, 0.0, 0.014431367628276348];
    let vgg = [0.01197492890059948, 0.002828144235536456, 0.054575372487306595, 0.0, 0.013888953253626823];
    let squeeze = [0.025161683559417725, 0.002967430278658867, 0.06485951691865921, 0.0, 0.015971513465046883];
    let missed = [("lpips-alex", alex), ("lpips-vgg", vgg), ("lpips-squeeze", squeeze)]
        .map(|(metric, expected)| misses(metric, expected, &conditions, 2e-6))
        .concat();
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn without_weights_they_are_left_out_and_say_what_is_missing() {
    let registry = ImageRegistry::standard();
    let names = |conditions: &Conditions| -> Vec<&str> {
        registry.applicable(Encoding::Srgb, conditions).iter().map(|metric| metric.name()).collect()
    };
    assert!(!names(&Conditions::default()).iter().any(|name| name.contains("lpips") || *name == "matsim"));
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("alex.pth"), b"x").expect("written");
    let conditions = conditions(folder.path());
    assert!(!names(&conditions).contains(&"lpips-alex"));
    fs::write(folder.path().join(ALEX), b"x").expect("written");
    assert!(names(&conditions).contains(&"lpips-alex"));
    let pair = pictures(40, 40);
    let refused = |metric: &str, conditions: &Conditions| {
        let metric = registry.get(metric).expect("a metric");
        metric.prepare(&pair[0], conditions).err().expect("no weights").to_string()
    };
    let missing = "lpips-vgg needs vgg.pth (or vgg.safetensors), which may not be shipped";
    assert_eq!(refused("lpips-vgg", &Conditions::default()), missing);
    assert_eq!(
        refused("lpips-vgg", &conditions),
        format!("{missing}; the folder {} has no such file", folder.path().display())
    );
    // Every file that a metric needs is in the list.
    let standard = ImageRegistry::standard();
    for metric in standard.iter().filter(|metric| !names(&Conditions::default()).contains(&metric.name())) {
        let listed = WEIGHTS_FILES.iter().any(|file| file.metrics.contains(&metric.name()));
        assert!(listed || metric.name() == "hdr-flip" || metric.name().starts_with("hdr-vdp"), "{}", metric.name());
    }
}

/// What is said of a folder whose file `name` has these bytes.
fn said(metric: &str, name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join(name), bytes).expect("written");
    let metric = ImageRegistry::standard().get(metric).expect("a metric");
    let error = metric.prepare(&pictures(40, 40)[0], &conditions(folder.path())).err().expect("wrong weights");
    let ImageMetricError::Weights(error) = error else { panic!("{error}") };
    assert!(error.path.ends_with(name), "{error}");
    error.reason
}

/// The same of tensors.
fn said_of(metric: &str, name: &str, tensors: &[Tensor]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    formula::write(&path, tensors);
    said(metric, name, &fs::read(path).expect("read"))
}

#[test]
fn wrong_weights_are_named() {
    let (metric, name) = ("st-lpips-alex", "alex_shift_tolerant.safetensors");
    let with = |change: &dyn Fn(&mut Vec<Tensor>)| {
        let mut tensors = formula::shift_tolerant_alex();
        change(&mut tensors);
        said_of(metric, name, &tensors)
    };
    let at = |tensors: &[Tensor], name: &str| tensors.iter().position(|t| t.name == name).expect("a tensor");
    let place = "net.slice4.11.bias";
    let missing = with(&|tensors| drop(tensors.remove(at(tensors, place))));
    assert_eq!(missing, "there is no tensor net.slice4.11.bias of 256");
    let extra = with(&|tensors| {
        tensors.push(Tensor { name: "net.slice6.1.weight".into(), shape: vec![1], values: vec![1.0] });
    });
    assert_eq!(extra, "tensor net.slice6.1.weight is none of this network's; it has 20 tensors");
    let shape = with(&|tensors| {
        let i = at(tensors, "net.slice1.0.weight");
        tensors[i].shape = vec![64, 3, 121];
    });
    assert_eq!(shape, "tensor net.slice1.0.weight is 64 x 3 x 121; it must be 64 x 3 x 11 x 11");
    let not_a_number = with(&|tensors| {
        let i = at(tensors, place);
        tensors[i].values[7] = f32::NAN;
    });
    assert_eq!(not_a_number, "number 7 of tensor net.slice4.11.bias is NaN; it must be finite");
    let zero = with(&|tensors| {
        let i = at(tensors, "scaling_layer.scale");
        tensors[i].values[1] = 0.0;
    });
    assert_eq!(zero, "number 1 of tensor scaling_layer.scale is 0; it must not be");
    let mut tensors = formula::matsim();
    let i = at(&tensors, "new_model.5.0.bn2.running_var");
    tensors[i].values[3] = -1.0;
    let negative = said_of("matsim", "model_best.safetensors", &tensors);
    assert_eq!(negative, "number 3 of tensor new_model.5.0.bn2.running_var is -1; it must be at least 0");
}

#[test]
fn files_that_are_no_weights_are_refused() {
    let checkpoint = said("st-lpips-alex", "alex_shift_tolerant.pth", b"no checkpoint at all");
    assert!(checkpoint.starts_with("it is no PyTorch checkpoint: "), "{checkpoint}");
    let safetensors = said("matsim", "model_best.safetensors", &[255; 40]);
    assert!(safetensors.starts_with("it is no safetensors file: "), "{safetensors}");
    // A header that promises more than there is, and one that is cut off.
    for bytes in [&b"PK\x03\x04 cut off"[..], &[0x80, 2, 0x8a, 10, 0x6c, 0xfc, 0x9c, 0x46], &[]] {
        let reason = said("st-lpips-vgg", "vgg_shift_tolerant.pth", bytes);
        assert!(reason.starts_with("it is no PyTorch checkpoint: "), "{reason}");
    }
    // A folder and a huge file with holes are refused before anything of them is read.
    let folder = tempfile::tempdir().expect("a folder");
    let huge = fs::File::create(folder.path().join("vgg_shift_tolerant.pth")).expect("created");
    huge.set_len((1 << 30) + 1).expect("made larger");
    fs::create_dir(folder.path().join("alex_shift_tolerant.pth")).expect("created");
    let reason = |metric: &str| {
        let metric = ImageRegistry::standard().get(metric).expect("a metric");
        metric.prepare(&pictures(40, 40)[0], &conditions(folder.path())).err().expect("wrong weights").to_string()
    };
    let huge = reason("st-lpips-vgg");
    assert!(huge.ends_with("it has 1073741825 bytes; a file of weights may have at most 1073741824"), "{huge}");
    assert!(reason("st-lpips-alex").ends_with("it is a folder; it must be a regular file"));
}

#[test]
fn weights_of_a_training_are_read_and_a_note_says_what_is_not_the_published_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut tensors = formula::shift_tolerant_alex();
    tensors.iter_mut().for_each(|tensor| tensor.name.insert_str(0, "state_dict.module."));
    tensors.push(Tensor { name: "optimizer.step".into(), shape: vec![1], values: vec![5.0] });
    formula::write(&folder.path().join("alex_shift_tolerant.safetensors"), &tensors);
    let nested = conditions(folder.path());
    let pair = pictures(67, 51);
    let plain = compared("st-lpips-alex", &pair, &conditions(FORMULA.path()), false);
    assert_eq!(compared("st-lpips-alex", &pair, &nested, false).distance, plain.distance);
    let notes = |conditions: &Conditions| conditions.weights.as_ref().expect("weights").notes();
    assert!(notes(&nested).is_empty(), "no checksum of a safetensors file is published");
    // PyTorch wrote this checkpoint of linear layers by formula; it is not the published one of this name.
    let linear = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/networks/alex.pth");
    let folder = tempfile::tempdir().expect("a folder");
    fs::copy(linear, folder.path().join("alex.pth")).expect("copied");
    fs::copy(FORMULA.path().join(ALEX), folder.path().join(ALEX)).expect("copied");
    let other = conditions(folder.path());
    let expected = compared("lpips-alex", &pair, &conditions(FORMULA.path()), false);
    assert_eq!(compared("lpips-alex", &pair, &other, false).distance, expected.distance);
    let notes = notes(&other);
    assert!(notes.len() == 1 && notes[0].contains("alex.pth is not the published file: its SHA-256 is "), "{notes:?}");
}
