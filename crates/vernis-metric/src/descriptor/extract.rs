//! The features of a BRDF, computed once.

use super::cache::{Cache, CacheWarning};
use super::features::BrdfFeatures;
use super::{DescriptorError, Setup};
use crate::brdf::IdentifiedBrdf;

/// The features of a BRDF, through the cache where there is one.
///
/// # Errors
/// A BRDF that cannot be decoded or evaluated, with its notation.
pub fn features(
    brdf: &IdentifiedBrdf,
    setup: &Setup,
    cache: Option<&Cache>,
) -> Result<(BrdfFeatures, Option<CacheWarning>), DescriptorError> {
    let computed = match cache {
        Some(cache) => cache.features(brdf, setup),
        None => brdf.brdf().map_err(DescriptorError::from).and_then(|b| Ok((BrdfFeatures::compute(b, setup)?, None))),
    };
    computed.map_err(|cause| match cause {
        // These name the file.
        DescriptorError::Open(_) => cause,
        cause => DescriptorError::Source { notation: brdf.notation.clone(), cause: Box::new(cause) },
    })
}
