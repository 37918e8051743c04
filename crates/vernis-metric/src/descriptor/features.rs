//! Everything that depends on one BRDF alone.

use super::wasserstein::ValueQuantiles;
use super::{DescriptorError, Setup, comparison, v1};
use crate::brdf::Brdf;
use crate::light::{NodeTable, Sites};
use crate::math::Rgb;
use crate::math::color::luminance;
use std::borrow::Cow;

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
    V2(comparison::Derived),
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

    /// The features of a BRDF that is given by its values (linear RGB, 1/sr) at the directions of [`Sites::of`] the setup's sampling.
    /// Negative values count as 0.
    ///
    /// # Errors
    /// [`DescriptorError::Length`] for another number of values; a value that is not finite.
    pub fn of_values(values: &[Rgb], setup: &Setup) -> Result<Self, DescriptorError> {
        let sites = Sites::of(setup.sampling());
        if values.len() != sites.len() {
            let what = "values of the BRDF";
            return Err(DescriptorError::Length { what, found: values.len(), expected: sites.len() });
        }
        let values: Cow<'_, [Rgb]> = match setup.version() {
            // What descriptors of version 1 are made from.
            1 => values.iter().map(|value| value.map(|v| f64::from(v as f32))).collect(),
            _ => values.into(),
        };
        Ok(Self::of_table(NodeTable::of_values(sites, &values)?, setup))
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
        let derived = match setup.version() {
            1 => Derived::V1(v1::Derived::new(&stored, setup.frame())),
            _ => Derived::V2(comparison::Derived::new(&stored, setup.frame())),
        };
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
            Derived::V2(derived) => derived.context(),
        }
    }

    /// Radiance of the pixels under light `light` (the last is the slot), linear RGB.
    pub fn picture(&self, light: usize) -> &[Rgb] {
        &self.stored.pictures[light]
    }
}
