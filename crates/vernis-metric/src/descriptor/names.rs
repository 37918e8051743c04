//! Names of descriptors, without their family. Every version of the descriptors has the same.

/// Names of the descriptors of pictures under lamps, without their family.
pub const LIGHTS: [&str; 18] = [
    "dE",
    "dE4",
    "adL",
    "dC",
    "sL",
    "mC",
    "sStd",
    "corr",
    "rms0",
    "q0-15",
    "q16-47",
    "q48-59",
    "q60-63",
    "struct0",
    "contrast0",
    "localstd0",
    "localstd2",
    "localmean3",
];
/// Names of the descriptors of pictures under the slot.
pub const SLOT: [&str; 6] = ["dE4", "dC", "sL", "rms0", "q48-59", "contrast0"];
/// Names of the further descriptors of pictures under the slot.
pub const SLOT_DETAIL: [&str; 8] = ["dE", "adL", "sStd", "corr", "q0-15", "q16-47", "q60-63", "w1"];
/// Regions whose mean log luminance ratio is used.
pub const SIGNED_REGIONS: [&str; 10] = ["1n", "3n", "5n", "7n", "2m", "6m", "2h", "5h", "3g", "7g"];
/// Regions whose mean absolute log luminance ratio is used.
pub const ABSOLUTE_REGIONS: [&str; 4] = ["2n", "5m", "7n", "3h"];

/// Names of the descriptors of pictures on a screen, without their light.
pub const DISPLAY: [&str; 6] = ["lin", "max", "rms", "mean", "corr", "std"];

/// Names of the numbers that describe one BRDF, and of their changes.
pub const CONTEXT: [&str; 10] =
    ["cx.0n", "cx.2n", "cx.5n", "cx.7n", "cxalb", "cxalb60", "cxwid.2", "cxwid.10", "cxwid.100", "cxexc"];

/// The descriptors that are norms of a difference, with their family: those whose plain forms a true metric adds up.
pub const NORMS: [&str; 18] = [
    "lights.dE",
    "lights.dE4",
    "lights.adL",
    "lights.dC",
    "lights.mC",
    "lights.rms0",
    "lights.localmean3",
    "slot.dE4",
    "slot.dC",
    "slot.rms0",
    "slot-detail.dE",
    "slot-detail.w1",
    "display.lamps.rms",
    "display.slot.rms",
    "angular.aY.2n",
    "angular.aY.5m",
    "angular.aY.7n",
    "angular.aY.3h",
];
