//! Every metric on pictures made by formula, without data: values of other programs where they run, and what must hold for each.

use std::sync::Arc;
use vernis_image::display::Display;
use vernis_image::metric::{Conditions, ImageMetric, ImageRegistry, Lab2000HlTable, ciede2000};
use vernis_image::picture::{EncodedPicture, Encoding};

const WIDTH: usize = 200;
const HEIGHT: usize = 170;

/// The code of channel `c` at column `x` and row `y`: ramps, a chess board and fine texture.
fn reference_code(x: usize, y: usize, c: usize) -> usize {
    20 + (3 * x + 2 * (c + 1) * y) % 150 + 60 * ((x / 16 + y / 16) % 2) + (x * x + 7 * y * (c + 1)) % 23
}

/// The same with noise, and brighter from column 120 on.
fn test_code(x: usize, y: usize, c: usize) -> usize {
    let noise = (x * 7919 + y * 104_729 + c * 1_299_709 + x * y * 31) % 29;
    let brighter = if x >= 120 { 12 } else { 0 };
    (reference_code(x, y, c) + noise + brighter).saturating_sub(14).min(255)
}

fn picture(encoding: Encoding, value: impl Fn(usize, usize, usize) -> f32) -> EncodedPicture {
    let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let pixels = places.map(|(x, y)| [0, 1, 2].map(|c| value(x, y, c))).collect();
    EncodedPicture::new(WIDTH, HEIGHT, pixels, encoding).expect("a picture")
}

fn codes(code: impl Fn(usize, usize, usize) -> usize) -> EncodedPicture {
    picture(Encoding::Srgb, |x, y, c| code(x, y, c) as f32)
}

/// (code + 1)^2/64 cd/m2, 21 times that in a disc.
fn light(code: impl Fn(usize, usize, usize) -> usize) -> EncodedPicture {
    picture(Encoding::Linear, |x, y, c| {
        let spot = x.abs_diff(100).pow(2) + y.abs_diff(80).pow(2) < 400;
        (code(x, y, c) + 1).pow(2) as f32 / 64.0 * if spot { 21.0 } else { 1.0 }
    })
}

/// A table of LAB2000HL of no use but for tests: half of a* and b*.
fn table() -> Lab2000HlTable {
    let places = (-128..=128).flat_map(|b| (-128..=128).map(move |a| [a as f32 / 2.0, b as f32 / 2.0]));
    Lab2000HlTable::decode(&places.flatten().flat_map(f32::to_le_bytes).collect::<Vec<u8>>()).expect("a table")
}

fn conditions() -> Conditions {
    Conditions { table: Some(Arc::new(table())), ..Conditions::default() }
}

/// Of codes: scikit-image 0.26.0 (`ssim*`, `cielab*`, `ciede2000`), numpy and scipy (`ms-ssim`, `psnr`), colour-science 0.4.7 (ITP),
/// flip-evaluator 1.7, and the formula of PU21 in numpy.
const CODES: [(&str, f64, f64); 12] = [
    ("ssim", 0.9673653326730206, 1e-6),
    ("ssim-y709", 0.9530503554616507, 1e-6),
    ("ssim-rgb", 0.9083264399543526, 1e-6),
    ("ms-ssim", 0.994860294118893, 1e-6),
    ("psnr", 29.002519875925834, 1e-6),
    ("cielab", 9.876503914596325, 1e-5),
    ("cielab-rms", 9.967323292437044, 1e-5),
    ("ciede2000", 6.577156258686515, 1e-5),
    ("delta-e-itp", 12.964050407346111, 1e-4),
    ("flip", 0.14282046258449554, 1e-3),
    ("pu21-psnr", 30.48498614779799, 1e-4),
    ("pu21-ssim", 0.9570882085295506, 1e-4),
];

/// Of light, by the same programs.
const LIGHT: [(&str, f64, f64); 4] = [
    ("delta-e-itp", 14.953913263144543, 1e-4),
    ("hdr-flip", 0.15373937785625458, 1e-3),
    ("pu21-psnr", 28.324808022431164, 1e-4),
    ("pu21-ssim", 0.9556726022587291, 1e-4),
];

#[test]
fn values_of_other_programs() {
    let registry = ImageRegistry::standard();
    let pairs =
        [(codes(reference_code), codes(test_code), &CODES[..]), (light(reference_code), light(test_code), &LIGHT[..])];
    for (reference, test, values) in pairs {
        for (name, expected, tolerance) in values {
            let prepared = registry.get(name).unwrap().prepare(&reference, &Conditions::default()).unwrap();
            let found = prepared.quality(&test).unwrap();
            assert!((found - expected).abs() <= *tolerance, "{name}: {found} {expected}");
        }
    }
}

/// Identical pictures are at distance 0, more noise is farther, and no number depends on the number of threads.
#[test]
fn distances_behave() {
    let registry = ImageRegistry::standard();
    for encoding in [Encoding::Srgb, Encoding::Linear] {
        let make = |code: fn(usize, usize, usize) -> usize| match encoding {
            Encoding::Srgb => codes(code),
            Encoding::Linear => light(code),
        };
        let (reference, test) = (make(reference_code), make(test_code));
        let mild = make(|x, y, c| (3 * reference_code(x, y, c) + test_code(x, y, c)) / 4);
        // Networks have tests of their own, with weights.
        let given = conditions();
        let takes = |m: &&Arc<dyn ImageMetric>| {
            m.properties().encodings.contains(&encoding) && m.properties().needs.iter().all(|need| given.meet(*need))
        };
        let metrics: Vec<_> = registry.iter().filter(takes).collect();
        assert!(metrics.len() >= 7);
        for metric in metrics {
            let name = metric.name();
            let prepared = metric.prepare(&reference, &conditions()).unwrap();
            let [same, near, far] = [&reference, &mild, &test].map(|picture| prepared.compare(picture, false).unwrap());
            assert_eq!(same.distance, 0.0, "{name}");
            assert!(near.distance > 0.0 && near.distance < far.distance, "{name}: {near:?} {far:?}");
            let better = if metric.properties().larger_is_better {
                near.quality > far.quality
            } else {
                near.quality < far.quality
            };
            assert!(better, "{name}");
            let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            let alone =
                one.install(|| metric.prepare(&reference, &conditions()).unwrap().compare(&test, true).unwrap());
            assert_eq!((alone.distance, alone.quality), (far.distance, far.quality), "{name}");
            assert_eq!(alone.map.is_some(), metric.properties().has_map, "{name}");
            if let Some(map) = alone.map {
                assert_eq!(map.values.len(), map.width * map.height, "{name}");
                assert!(map.white > 0.0 && map.values.iter().all(|v| v.is_finite()), "{name}");
                assert!(map.values.iter().any(|v| *v > 0.0), "{name}");
            }
        }
    }
}

#[test]
fn what_cannot_be_compared_is_said() {
    let registry = ImageRegistry::standard();
    let metric = |name: &str| registry.get(name).unwrap();
    let none = Conditions::default();
    let unknown = |name: &str| registry.get(name).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(
        unknown("sim").starts_with("no metric on pictures is called \"sim\"; did you mean ssim, "),
        "{}",
        unknown("sim")
    );
    assert!(unknown("qwertyuiop").ends_with("no name is similar"));
    let small = |encoding, n: usize| EncodedPicture::new(n, 20, vec![[1.0; 3]; n * 20], encoding).unwrap();
    let refused = |name: &str, picture: &EncodedPicture, conditions: &Conditions| {
        metric(name).prepare(picture, conditions).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let codes = small(Encoding::Srgb, 10);
    assert_eq!(refused("ssim", &codes, &none), "the pictures have 10 x 20 pixels; ssim needs at least 11 x 11");
    assert_eq!(
        refused("ssim", &small(Encoding::Linear, 20), &none),
        "the pictures hold linear light (of an EXR, HDR or PFM); ssim needs sRGB codes (of a PNG or JPEG)"
    );
    assert!(refused("hdr-flip", &codes, &none).contains("hdr-flip needs linear light"));
    assert_eq!(
        refused("cid", &small(Encoding::Srgb, 20), &none),
        "cid needs the table of LAB2000HL, which may not be shipped; without it use cid-cielab, the same metric in CIELAB"
    );
    for ppd in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let conditions = Conditions { ppd: Some(ppd), ..Conditions::default() };
        assert!(refused("flip", &codes, &conditions).ends_with("there must be 1 to 1000"), "{ppd}");
    }
    let display = Conditions { display: Some(Display::StandardHdrLinear), ..Conditions::default() };
    assert_eq!(
        refused("cvvdp", &small(Encoding::Srgb, 20), &display),
        "display standard-hdr-linear shows linear light (of an EXR, HDR or PFM); the pictures hold sRGB codes (of a PNG or JPEG)"
    );
    let dark = EncodedPicture::new(20, 20, vec![[0.0; 3]; 400], Encoding::Linear).unwrap();
    assert!(refused("hdr-flip", &dark, &none).starts_with("hdr-flip is undefined: half of the reference's pixels"));
    let prepared = metric("psnr").prepare(&codes, &none).unwrap();
    let other = prepared.distance(&small(Encoding::Srgb, 11)).unwrap_err().to_string();
    assert_eq!(other, "the test picture has 11 x 20 pixels; it must have as many as the reference, 10 x 20");
    let kinds = prepared.distance(&small(Encoding::Linear, 10)).unwrap_err().to_string();
    assert!(kinds.starts_with("the reference holds sRGB codes"), "{kinds}");
}

/// Pictures of one pixel, of black alone and of the brightest light: a number or a message, never NaN.
#[test]
fn extremes_have_a_number_or_a_message() {
    let registry = ImageRegistry::standard();
    for (encoding, most) in [(Encoding::Srgb, 255.0), (Encoding::Linear, 1e10)] {
        for side in [1, 11, 17, 40] {
            let even = |v: f32| EncodedPicture::new(side, side, vec![[v, 0.0, v]; side * side], encoding).unwrap();
            for metric in registry.iter() {
                for (a, b) in [(0.0, 0.0), (0.0, most), (most, 0.0), (most, most), (1e-30, 1e-38)] {
                    let prepared = metric.prepare(&even(a), &conditions());
                    let Ok(found) = prepared.and_then(|p| p.compare(&even(b), false)) else { continue };
                    let fit = if a == b { found.distance == 0.0 } else { found.distance >= 0.0 };
                    assert!(fit && found.distance.is_finite(), "{} {side} {a} {b}: {found:?}", metric.name());
                }
            }
        }
    }
}

/// Table 1 of Sharma, Wu and Dalal 2005 (doi:10.1002/col.20070): L*, a*, b* of both colours, CIEDE2000.
const SHARMA: [[f64; 7]; 34] = [
    [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
    [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
    [50.0, 2.8361, -74.0200, 50.0, 0.0, -82.7485, 3.4412],
    [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
    [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0009, 7.1792],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0010, 7.1792],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0011, 7.2195],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0012, 7.2195],
    [50.0, -0.0010, 2.4900, 50.0, 0.0009, -2.4900, 4.8045],
    [50.0, -0.0010, 2.4900, 50.0, 0.0010, -2.4900, 4.8045],
    [50.0, -0.0010, 2.4900, 50.0, 0.0011, -2.4900, 4.7461],
    [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
    [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
    [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
    [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.9030],
    [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
    [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 3.2592, 0.3350, 1.0000],
    [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
    [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
    [61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731],
    [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
    [22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373],
    [36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
    [90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441],
    [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
    [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
    [2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082],
];

/// To the four decimals of the paper.
#[test]
fn ciede2000_has_the_values_of_its_test_data() {
    for (i, [l1, a1, b1, l2, a2, b2, expected]) in SHARMA.into_iter().enumerate() {
        let (one, other) = ([l1, a1, b1], [l2, a2, b2]);
        for found in [ciede2000(one, other), ciede2000(other, one)] {
            assert!((found - expected).abs() <= 0.00005 + 1e-9, "pair {}: {found} {expected}", i + 1);
        }
    }
}
