//! RGL's measurements against Mitsuba, and files that are none.

use super::{message, open};
use crate::data_folder;
use std::fs;
use std::path::Path;
use vernis_metric::brdf::formats::rgl;
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, Vec3};
use vernis_metric::metric::registry::{Registry, distances};

/// Viewer, light, and linear RGB (1/sr) by Mitsuba 3.9.1, plugin `measured`, variant scalar_rgb, single precision: the value of
/// `eval` with wi = viewer, divided by the cosine of the light. Of each file: a highlight, the lowest component, two others, and one
/// where the measured direction does not lie in the plane of x and z.
#[rustfmt::skip]
const VALUES: [(&str, [f64; 3], [f64; 3], Rgb); 15] = [
    ("aurora_white_rgb.bsdf", [0.9672726867906063, 0.0, 0.2537391364943169], [-0.9648916234435868, 0.04225550438700123, 0.25922698038089986], [27.510423362866167, 29.217269372130517, 29.695947863939335]),
    ("aurora_white_rgb.bsdf", [0.8246226341935887, 0.0, 0.5656832251142213], [0.44928469078775946, -0.8573196219300272, 0.2512893401589144], [0.13298236118673543, 0.11932295967875467, 0.11346256113250287]),
    ("aurora_white_rgb.bsdf", [0.3939085337217977, 0.0, 0.9191496434537433], [0.4147355629518921, 0.013922475063677135, 0.9098354672747586], [0.19151638248642872, 0.14393162982968527, 0.18510664351542613]),
    ("aurora_white_rgb.bsdf", [0.30008261222163524, 0.0, 0.9539132171441171], [-0.15942784546474473, 0.37398671901903935, 0.9136283139700978], [0.22868889173626727, 0.2584256871250306, 0.24073309639598636]),
    ("aurora_white_rgb.bsdf", [0.022745077030331212, 0.8136840082281508, 0.5808622867983898], [0.9549015619269833, 0.0, 0.2969225606608696], [0.16843403776171717, 0.1496062903821436, 0.1429400329742641]),
    ("cc_green_malachite_rgb.bsdf", [0.8880072049199267, 0.0, 0.45982953799239495], [-0.8796357027346706, 0.0020166558493988737, 0.4756437359764839], [7.58257257019291, 36.15698125190359, 7.9270116280680565]),
    ("cc_green_malachite_rgb.bsdf", [0.9838833885747023, 0.0, 0.17881129071387378], [-0.9820085054791597, 0.028556894530951102, 0.18666493763247363], [-1.8504740976614744, 5.842604004212115, 3.6568401367564567]),
    ("cc_green_malachite_rgb.bsdf", [0.9018596575537682, 0.0, 0.4320291171634152], [0.9217257651148143, 0.003687955543209366, 0.38782471930940837], [0.0007906632254942234, 0.0013751971140164717, 0.0008083060917261453]),
    ("cc_green_malachite_rgb.bsdf", [0.1330460139820282, 0.0, 0.9911098618031676], [-0.6978018952637884, -0.6746321383339772, 0.24071558506501062], [0.044818264140523596, 0.053513607423113986, 0.009698539476194827]),
    ("cc_green_malachite_rgb.bsdf", [0.037472244632638436, 0.07335592923294845, 0.9966015946849385], [0.20560388167810856, 0.0, 0.9786352966447176], [0.008238177978468644, 0.14493120773519128, 0.012760679448664769]),
    ("chm_orange_rgb.bsdf", [0.714176835301287, 0.0, 0.6999653190830517], [-0.7067345528524561, -0.0053504474806983044, 0.7074585814845948], [872.0903959889148, 162.39117831141928, 87.83091425422495]),
    ("chm_orange_rgb.bsdf", [0.5518304022635807, 0.0, 0.8339563580533544], [0.48492918048950767, -0.07951105948359892, 0.870931502088178], [0.001920518669961044, 0.000962554741805605, 0.0007538050516449767]),
    ("chm_orange_rgb.bsdf", [0.5222021156222297, 0.0, 0.8528217577194354], [0.4799852581907937, 0.01599397351627006, 0.8771307455166978], [0.013054892522420734, 0.006541492058534508, 0.00507968912030799]),
    ("chm_orange_rgb.bsdf", [0.8514399953715079, 0.0, 0.5244520323935894], [-0.43639353923288826, -0.03701637960493715, 0.8989941415586293], [0.013907139043691246, 0.005065954905846457, 0.004010312276480042]),
    ("chm_orange_rgb.bsdf", [0.18516508038101645, -0.04037886931190879, 0.9818775075948035], [0.582686722956784, 0.0, 0.8126968579303626], [0.008214638364036934, 0.004009850803954619, 0.0034194221531351553]),
];

/// Single precision moves the highlights of the mirror-like foil by up to 1e-5.
#[test_with::env(VERNIS_DATA)]
#[test]
fn measurements_have_the_values_of_mitsuba() {
    let data = data_folder();
    let vector = |[x, y, z]: [f64; 3]| Vec3::new(x, y, z).normalized();
    for (file, viewer, light, expected) in VALUES {
        let brdf = open(file, &data).expect("a file of the data folder");
        let found = brdf.eval(vector(light), vector(viewer)).expect("every facet was seen");
        for c in 0..3 {
            assert!((found[c] - expected[c]).abs() < 1e-6 + 3e-5 * expected[c].abs(), "{file} {found:?} {expected:?}");
        }
        // Turned about the normal it is the same.
        let (sin, cos) = 2.2f64.sin_cos();
        let turn = |w: Vec3| Vec3::new(cos * w.x - sin * w.y, sin * w.x + cos * w.y, w.z);
        let turned = brdf.eval(turn(vector(light)), turn(vector(viewer))).expect("as before");
        assert!((0..3).all(|c| (turned[c] - found[c]).abs() < 1e-9 * (1.0 + found[c].abs())), "{turned:?} {found:?}");
    }
}

/// Colours outside the gamut are 0 in tables and metrics.
#[test_with::env(VERNIS_DATA)]
#[test]
fn colours_outside_the_gamut_can_be_compared() {
    let brdf = open("cc_green_malachite_rgb.bsdf", &data_folder()).expect("a file of the data folder");
    let grid = Grid::Standard { theta_i: 18, theta_o: 18, phi_d: 36, anchor: vernis_metric::brdf::Anchor::Centre };
    let table = TabulatedBrdf::tabulate(&*brdf, grid).expect("not negative");
    let (wi, wo) = grid.directions((15 * 18 + 15) * 36 + 17);
    assert!(brdf.eval(wi, wo).expect("measured")[0] < 0.0);
    assert_eq!(table.eval(wi, wo).expect("measured")[0], 0.0);
    let metrics = Registry::standard().and_then(|r| r.resolve("ot[grid=9x9x18]")).expect("a metric");
    assert_eq!(distances(&metrics, &*brdf, &*brdf).expect("comparable")[0].value, 0.0);
}

/// An array: name, type, shape, numbers.
type Array = (&'static str, u8, Vec<u64>, Vec<f32>);

fn file(arrays: &[Array]) -> Vec<u8> {
    let mut head = [&b"tensor_file\0\x01\0"[..], &(arrays.len() as u32).to_le_bytes()].concat();
    let size: usize = arrays.iter().map(|(name, _, shape, _)| 13 + name.len() + 8 * shape.len()).sum();
    let (start, mut data) = (head.len() + size, Vec::new());
    for (name, kind, shape, numbers) in arrays {
        head.extend((name.len() as u16).to_le_bytes());
        head.extend(name.as_bytes());
        head.extend((shape.len() as u16).to_le_bytes());
        head.push(*kind);
        head.extend(((start + data.len()) as u64).to_le_bytes());
        shape.iter().for_each(|n| head.extend(n.to_le_bytes()));
        match kind {
            1 => data.extend(numbers.iter().map(|n| *n as u8)),
            _ => data.extend(numbers.iter().flat_map(|n| n.to_le_bytes())),
        }
    }
    [head, data].concat()
}

/// A surface of facets that are all seen alike; `azimuths` of the viewer.
fn arrays(azimuths: u64) -> Vec<Array> {
    let phi: Vec<f32> = (0..azimuths).map(|k| k as f32 * 0.3).collect();
    let ones = |count: u64| vec![1.0; count as usize];
    vec![
        ("description", 1, vec![4], vec![116.0, 101.0, 115.0, 116.0]),
        ("phi_i", 10, vec![azimuths], phi),
        ("theta_i", 10, vec![2], vec![0.0, 1.5]),
        ("ndf", 10, vec![2, 3], vec![2.0; 6]),
        ("sigma", 10, vec![2, 2], vec![0.5; 4]),
        ("vndf", 10, vec![azimuths, 2, 3, 4], ones(24 * azimuths)),
        ("rgb", 10, vec![azimuths, 2, 3, 2, 2], ones(24 * azimuths)),
        ("jacobian", 1, vec![1], vec![1.0]),
    ]
}

#[test]
fn a_file_of_equal_numbers_has_the_value_of_its_formula() {
    let path = Path::new("x.bsdf");
    for azimuths in [1, 2] {
        let brdf = rgl::decode(path, &file(&arrays(azimuths))).expect("a valid file");
        let (light, viewer) = (Vec3::from_spherical(0.5, 2.0), Vec3::from_spherical(1.0, -1.0));
        // 1 * D / (4 sigma) / cos = 2 / (4 * 0.5) / cos.
        let found = brdf.eval(light, viewer).expect("seen");
        assert!(found.iter().all(|f| (f - 1.0 / light.z).abs() < 1e-12), "{found:?}");
        assert_eq!(brdf.eval(-light, viewer), Some([0.0; 3]));
        assert_eq!(brdf.description().as_deref(), Some("measurement of the RGL database, 2 elevations: test"));
    }
    let mut plain = arrays(1);
    plain[7].3 = vec![0.0];
    let brdf = rgl::decode(path, &file(&plain)).expect("a valid file");
    let up = Vec3::new(0.0, 0.0, 1.0);
    assert_eq!(brdf.eval(up, up), Some([1.0; 3]));
}

#[test]
fn rows_that_no_direction_sees_have_no_value() {
    let mut some = arrays(1);
    // Both slices are 0 in the lower half of their azimuths.
    for slice in some[5].3.chunks_mut(12) {
        slice[..8].fill(0.0);
    }
    let brdf = rgl::decode(Path::new("x.bsdf"), &file(&some)).expect("a valid file");
    let viewer = Vec3::from_spherical(0.2, 0.0);
    let light = |phi: f64| Vec3::from_spherical(1.2, phi);
    assert_eq!(brdf.eval(light(-2.0), viewer), None);
    assert!(brdf.eval(light(2.0), viewer).is_some());
}

#[test]
fn other_files_are_refused_for_what_they_are() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let refused = |bytes: &[u8], expected: &str| {
        fs::write(folder.path().join("x.bsdf"), bytes).expect("writable");
        let text = message(open("x.bsdf", folder.path()));
        assert!(text.contains("x.bsdf: ") && text.contains(expected) && text.len() < 500, "{text}\n{expected}");
    };
    refused(b"", "it does not begin with `tensor_file`");
    refused(b"Source  Measured\nSymmetry  PlaneSymmetrical\n", "such as Zemax");
    refused(&file(&arrays(16)), "it is anisotropic (`phi_i` has 16 azimuths)");
    let mut spectral = arrays(1);
    spectral[6].0 = "spectra";
    spectral.push(("wavelengths", 10, vec![3], vec![400.0, 500.0, 600.0]));
    refused(&file(&spectral), "it holds spectra at 3 wavelengths; vernis needs RGB values");
    let changed = |k: usize, change: fn(&mut Array)| {
        let mut all = arrays(1);
        change(&mut all[k]);
        file(&all)
    };
    for (bytes, expected) in [
        (changed(3, |a| a.0 = "NDF"), "it has no array `ndf`; its arrays are description, phi_i, theta_i, NDF"),
        (changed(3, |a| a.0 = "sigma"), "the array `sigma` is there twice"),
        (changed(3, |a| a.2 = vec![6]), "`ndf` has 1 axes; it must have 2"),
        (changed(3, |a| a.3[4] = f32::NAN), "`ndf` holds NaN at 4; it must hold finite numbers that are not negative"),
        (changed(3, |a| a.3[0] = -1.0), "`ndf` holds -1 at 0"),
        (changed(3, |a| a.1 = 6), "`ndf` is of type 6; it must be 10 (f32)"),
        (changed(3, |a| a.1 = 77), "`ndf` is of type 77; the types are 1 to 11"),
        (changed(2, |a| a.3 = vec![0.5, 0.5]), "`theta_i` must increase from 0.0000 or more to 1.5708 or less"),
        (changed(2, |a| a.3 = vec![0.0, 3.0]), "`theta_i` must increase"),
        (changed(5, |a| a.3.fill(0.0)), "slice 0 of `vndf` has no finite, positive sum"),
        (changed(5, |a| a.2 = vec![1, 2, 1, 12]), "`vndf` has 1 x 12 nodes; it must have at least 2 x 2"),
        (changed(5, |a| a.2 = vec![1, 3, 2, 4]), "`vndf` is for 1 phi_i and 3 theta_i; there are 1 and 2"),
        (changed(6, |a| a.2 = vec![1, 2, 4, 3, 1]), "`rgb` has 4 channels; it must have 3"),
        (changed(6, |a| a.3[7] = f32::INFINITY), "`rgb` holds inf at 7; it must hold finite numbers"),
        (changed(6, |a| a.2 = vec![1, 2, 3, u64::MAX, 2]), "ends behind the"),
        (changed(6, |a| a.2 = vec![1, 2, 3, 2, 200]), "`rgb` with 1x2x3x2x200 numbers from byte"),
        (changed(7, |a| a.2 = vec![0]), "`jacobian` has 0 numbers; it must have 1"),
    ] {
        refused(&bytes, expected);
    }
    let good = file(&arrays(1));
    refused(&good[..40], "its header is cut off after 40 bytes");
    refused(&good[..good.len() - 1], "ends behind the");
    let with = |at: usize, bytes: &[u8]| [&good[..at], bytes, &good[at + bytes.len()..]].concat();
    refused(&with(12, &[7]), "its version is 7.0; it must be 1.0");
    refused(&with(14, &u32::MAX.to_le_bytes()), "it says that it holds 4294967295 arrays; at most 64");
    refused(&with(18, &u16::MAX.to_le_bytes()), "the name of an array has 65535 bytes");
    // Where the numbers of the first array begin.
    refused(
        &with(18 + 2 + 11 + 3, &u64::MAX.to_le_bytes()),
        "`description` with 4 numbers from byte 18446744073709551615 on ends",
    );
}

#[test]
fn an_archive_may_hold_measurements() {
    use std::io::Write;
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut zip = zip::ZipWriter::new(fs::File::create(folder.path().join("all.zip")).expect("writable"));
    zip.start_file("in/foil.bsdf", zip::write::SimpleFileOptions::default()).expect("a name");
    zip.write_all(&file(&arrays(1))).expect("writable");
    zip.finish().expect("writable");
    let up = Vec3::new(0.0, 0.0, 1.0);
    assert!(open("all.zip:foil", folder.path()).expect("a member").eval(up, up).is_some());
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn a_loose_network_is_the_member_of_the_archive() {
    let data = data_folder();
    let path = data.join("nbrdf/merl_nbrdf.zip");
    let bytes = vernis_metric::brdf::formats::archive::member(&path, "teflon").expect("in the archive").bytes;
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::write(folder.path().join("teflon.h5"), &bytes).expect("writable");
    let (wi, wo) = (Vec3::from_spherical(0.5, 0.0), Vec3::from_spherical(0.4, 3.0));
    let loose = open("teflon.h5", folder.path()).expect("a network").eval(wi, wo);
    assert_eq!(loose, open("merl_nbrdf.zip:teflon", &data).expect("a member").eval(wi, wo));
    fs::write(folder.path().join("half.h5"), &bytes[..bytes.len() / 2]).expect("writable");
    assert!(message(open("half.h5", folder.path())).contains("half.h5: not a valid NBRDF network: "));
}
