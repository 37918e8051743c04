//! Lights and shape of the descriptors, as options.

use super::limits;
use clap::Args;
use std::path::PathBuf;
use vernis_metric::descriptor::{DescriptorOptions, Lights, ShapeChoice};

/// Under which light and on which shape BRDFs are looked at.
#[derive(Args)]
pub struct View {
    /// A light probe (latitude/longitude, Radiance .hdr) to train with instead of the lights defined by code; elsewhere, the one that
    /// an exported metric was trained with.
    #[arg(long, value_name = "HDR", value_parser = limits::file)]
    lights: Option<PathBuf>,
    /// A mesh (ASCII .ply) to train with, whose normals weight the pictures instead of the sphere's; elsewhere, the one that an
    /// exported metric was trained with.
    #[arg(long, value_name = "PLY", value_parser = limits::file)]
    shape: Option<PathBuf>,
}

impl View {
    /// The files that are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.lights.iter().chain(&self.shape)
    }

    pub fn options(&self) -> DescriptorOptions {
        DescriptorOptions {
            lights: self.lights.clone().map_or(Lights::default(), Lights::Probe),
            shape: self.shape.clone().map_or(ShapeChoice::default(), ShapeChoice::Mesh),
        }
    }
}
