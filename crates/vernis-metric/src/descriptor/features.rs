//! Everything that depends on one BRDF alone.

use super::wasserstein::ValueQuantiles;
use super::{DescriptorError, Setup, v1};
use crate::brdf::Brdf;
use crate::light::node_table::NodeTable;
use crate::math::Rgb;
use crate::math::color::luminance;

/// What is worth keeping in a cache: the samples of a BRDF and the pictures and albedos they give.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stored {
    pub table: NodeTable,
    /// Linear RGB radiance, `[light][pixel]`.
    pub pictures: Vec<Vec<Rgb>>,
    /// Luminance albedo from 0 and 60 deg.
    pub albedo: [f64; 2],
}

/// What comparisons use, by version of the descriptors.
#[derive(Debug, Clone)]
pub(super) enum Derived {
    V1(v1::Derived),
}

/// A BRDF ready to be compared.
#[derive(Debug, Clone)]
pub struct BrdfFeatures {
    pub(super) stored: Stored,
    pub(super) derived: Derived,
    pub(super) quantiles: ValueQuantiles,
}

impl BrdfFeatures {
    /// Samples `brdf` and takes its pictures. Errors: see [`NodeTable::sample`].
    pub fn compute(brdf: &dyn Brdf, setup: &Setup) -> Result<Self, DescriptorError> {
        Ok(Self::of_table(NodeTable::sample(brdf, setup.sampling())?, setup))
    }

    /// Takes the pictures of a table, which was sampled as `setup` samples.
    pub fn of_table(table: NodeTable, setup: &Setup) -> Self {
        let operators = setup.operators();
        let mut pictures = operators.pictures.apply(table.values());
        if setup.version() == 1 {
            pictures.iter_mut().flatten().flatten().for_each(|v| *v = f64::from(*v as f32));
        }
        let albedo = &operators.albedo.apply(table.values())[0];
        let albedo = [luminance(albedo[0]), luminance(albedo[1])];
        Self::from_stored(Stored { table, pictures, albedo }, setup)
    }

    /// Derives from the stored part what comparisons use.
    pub(super) fn from_stored(stored: Stored, setup: &Setup) -> Self {
        let derived = Derived::V1(v1::Derived::new(&stored, setup.frame()));
        let quantiles = ValueQuantiles::new(&stored.table);
        Self { stored, derived, quantiles }
    }

    /// The samples of the BRDF.
    pub fn table(&self) -> &NodeTable {
        &self.stored.table
    }

    /// What kind of material it is, in the order of [`super::names::CONTEXT`].
    pub fn context(&self) -> [f64; 10] {
        match &self.derived {
            Derived::V1(derived) => derived.context(),
        }
    }

    /// Radiance of the pixels under light `light` (the last is the slot), linear RGB.
    pub fn picture(&self, light: usize) -> &[Rgb] {
        &self.stored.pictures[light]
    }
}
