//! Everything that depends on one BRDF alone.

use super::angular::AngularProfile;
use super::context::{Context, context};
use super::display::Displayed;
use super::picture::Picture;
use super::wasserstein::ValueQuantiles;
use super::{DescriptorError, Setup};
use crate::brdf::Brdf;
use crate::light::node_table::NodeTable;
use crate::math::Rgb;
use crate::math::color::luminance;

/// What is worth keeping in a cache: the samples of a BRDF and the pictures and albedos they give.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stored {
    pub table: NodeTable,
    /// Linear RGB radiance, `[light][pixel]`.
    pub pictures: Vec<Vec<[f32; 3]>>,
    /// Luminance albedo from 0 and 60 deg.
    pub albedo: [f64; 2],
}

/// A BRDF ready to be compared.
#[derive(Debug, Clone)]
pub struct BrdfFeatures {
    pub(super) stored: Stored,
    pub(super) pictures: Vec<Picture>,
    pub(super) displayed: Vec<Displayed>,
    pub(super) angular: AngularProfile,
    pub(super) context: Context,
    pub(super) quantiles: ValueQuantiles,
}

impl BrdfFeatures {
    /// Samples `brdf` and takes its pictures. Errors: see [`NodeTable::sample`].
    pub fn compute(brdf: &dyn Brdf, setup: &Setup) -> Result<Self, DescriptorError> {
        let table = NodeTable::sample(brdf)?;
        let operators = setup.operators();
        let pictures = operators.pictures.apply(table.values());
        let pictures = pictures.iter().map(|p| p.iter().map(|c| c.map(|v| v as f32)).collect()).collect();
        let albedo = &operators.albedo.apply(table.values())[0];
        let albedo = [luminance(albedo[0]), luminance(albedo[1])];
        Ok(Self::from_stored(Stored { table, pictures, albedo }, setup))
    }

    /// Derives from the stored part what comparisons use.
    pub(super) fn from_stored(stored: Stored, setup: &Setup) -> Self {
        let (pictures, displayed) = stored
            .pictures
            .iter()
            .map(|picture| {
                let radiance: Vec<Rgb> = picture.iter().map(|c| c.map(f64::from)).collect();
                (Picture::new(setup.frame(), &radiance), Displayed::new(setup.frame(), &radiance))
            })
            .unzip();
        let angular = AngularProfile::new(&stored.table);
        let context = context(&stored.table, &angular, stored.albedo);
        let quantiles = ValueQuantiles::new(&stored.table);
        Self { stored, pictures, displayed, angular, context, quantiles }
    }

    /// The samples of the BRDF.
    pub fn table(&self) -> &NodeTable {
        &self.stored.table
    }

    /// The samples and their logarithms, as [`super::angular::ratios`] takes them.
    pub fn angular_parts(&self) -> (&NodeTable, &AngularProfile) {
        (&self.stored.table, &self.angular)
    }

    /// What kind of material it is, in the order of [`super::context::NAMES`].
    pub fn context(&self) -> Context {
        self.context
    }

    /// Radiance of the pixels under light `light` (the last is the slot), linear RGB.
    pub fn picture(&self, light: usize) -> &[[f32; 3]] {
        &self.stored.pictures[light]
    }
}
