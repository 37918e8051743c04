//! Tables written, read back and resampled.

use super::open;
use vernis_metric::brdf::formats::{merl, titopo};
use vernis_metric::brdf::models::Ggx;
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};

const MODEL: Ggx = Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04, 0.05, 0.9], alpha: 0.2 };

/// A table of a model with some valid cells masked.
fn table(grid: Grid) -> TabulatedBrdf {
    let full = TabulatedBrdf::tabulate(&MODEL, grid).expect("finite model");
    let valid = full.valid().iter().enumerate().map(|(k, v)| *v && k % 11 != 3).collect();
    TabulatedBrdf::new(grid, full.values().to_vec(), valid).expect("same values")
}

fn assert_same(a: &TabulatedBrdf, b: &TabulatedBrdf) {
    assert_eq!(a.grid(), b.grid());
    assert!(a.valid() == b.valid());
    let same = |k: usize| !a.valid()[k] || a.values()[k] == b.values()[k];
    assert!((0..a.values().len()).all(same));
}

#[test]
fn a_table_survives_writing_and_reading_bit_for_bit() {
    let folder = tempfile::tempdir().expect("temporary folder");
    for (name, grid, size) in [
        ("reciprocal.binary", Grid::MERL, 34_992_012),
        ("full.binary", Grid::MERL_FULL, 69_984_012),
        ("x.T.titopo", Grid::TITOPO, 34_992_000),
        ("x.T.titopoh", Grid::TITOPO_HALF, 4_374_000),
    ] {
        let (path, table) = (folder.path().join(name), table(grid));
        let merl = name.ends_with("binary");
        if merl { merl::write(&path, &table) } else { titopo::write(&path, &table) }.expect("writable folder");
        assert_eq!(path.metadata().expect("written").len(), size, "{name}");
        let read = if merl { merl::read(&path) } else { titopo::read(&path) }.expect("just written");
        assert_same(&read, &table);
        assert!(open(name, folder.path()).expect("notation").as_table().is_some());
    }
    assert_eq!(folder.path().read_dir().expect("folder").count(), 4, "no temporary file is left");
}

/// Every cell of the resampled table holds the value of the cell that its directions fall into.
#[test]
fn resampling_takes_value_and_validity_of_the_containing_cell() {
    let grids = [Grid::MERL, Grid::MERL_FULL, Grid::TITOPO, Grid::TITOPO_HALF];
    for from in grids {
        let source = table(from);
        for to in grids {
            let target = source.resampled(to).expect("valid cells remain");
            for index in (0..to.len()).step_by(101) {
                let (wi, wo) = to.directions(index);
                // At the pole the azimuth is lost.
                if wi.z.max(wo.z) > 1.0 - 1e-12 {
                    continue;
                }
                let expected = from.cell(wi, wo).filter(|cell| source.valid()[*cell]);
                assert_eq!(target.valid()[index], expected.is_some());
                if let Some(cell) = expected {
                    assert_eq!(target.values()[index], source.values()[cell]);
                }
            }
        }
    }
}

/// `.titopoh` is defined as every second sample of `.titopo`.
#[test]
fn half_resolution_is_every_second_sample() {
    let full = table(Grid::TITOPO);
    let half = full.resampled(Grid::TITOPO_HALF).expect("valid cells remain");
    for (i, j, k) in [(0, 0, 0), (3, 7, 100), (44, 44, 179), (20, 20, 90)] {
        let (at_full, at_half) = ((2 * i * 90 + 2 * j) * 360 + 2 * k, (i * 45 + j) * 180 + k);
        assert_eq!(half.values()[at_half], full.values()[at_full]);
        assert_eq!(half.valid()[at_half], full.valid()[at_full]);
    }
}

#[test]
fn masked_cells_are_unknown_and_not_black() {
    let table = table(Grid::TITOPO_HALF);
    let masked = (20 * 45 * 180..).find(|k| !table.valid()[*k]).expect("masked above");
    let (wi, wo) = table.grid().directions(masked);
    assert_eq!(table.eval(wi, wo), None);
}
