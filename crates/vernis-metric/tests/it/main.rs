//! The one integration binary of the package: each room's tests are a module.

mod brdf;
mod descriptor;
mod descriptor_v2;
mod fit;
mod golden;
mod gradient;
mod graph;
mod learned_gradient;
mod lp;
mod lp_golden;
mod naive_lp;
mod principled;
mod transport;
mod transport_golden;
mod transport_golden_p1;
mod transport_pairs;

use std::path::PathBuf;

// So that a change of the variable makes the tests anew: those that need data are ignored where it is not set.
const _: Option<&str> = option_env!("VERNIS_DATA");

/// The folder with published data.
fn data_folder() -> PathBuf {
    let folder = PathBuf::from(std::env::var_os("VERNIS_DATA").expect("VERNIS_DATA names the data folder"));
    assert!(folder.is_dir(), "VERNIS_DATA names {}, which is no folder", folder.display());
    folder
}

/// Where data must be there, tests that need them are not merely ignored.
#[test]
fn data_are_there_where_they_are_required() {
    if std::env::var_os("VERNIS_REQUIRE_DATA").is_some_and(|required| required == "1") {
        assert!(
            option_env!("VERNIS_DATA").is_some(),
            "VERNIS_REQUIRE_DATA is 1, but VERNIS_DATA was not set at compile time"
        );
        data_folder();
    }
}
