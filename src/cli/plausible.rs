//! What commands say of BRDFs whose values cannot be those of a material.

use super::{user_error, workspace};
use anyhow::Result;
use serde_json::{Value, json};
use vernis_metric::brdf::plausibility::{Plausibility, VERSION};
use vernis_metric::brdf::{Brdf, IdentifiedBrdf};
use vernis_metric::descriptor::Cache;
use vernis_metric::io::shown;

/// Warns on standard error, and returns what was found.
pub fn warn(notation: &str, brdf: &dyn Brdf) -> Plausibility {
    let found = Plausibility::of(brdf);
    workspace::warn(warnings(notation, &found));
    found
}

/// Of a table from the cache, or looked at and kept.
pub fn kept(brdf: &IdentifiedBrdf, cache: &Cache) -> Result<Plausibility> {
    if brdf.is_open() {
        return Ok(Plausibility::of(brdf.brdf().map_err(user_error)?));
    }
    let key = format!("plausibility {VERSION} {}", brdf.content);
    if let Some(kept) = cache.load_values(&key).and_then(|numbers| Plausibility::from_numbers(&numbers)) {
        return Ok(kept);
    }
    let brdf = brdf.brdf().map_err(user_error)?;
    let found = Plausibility::of(brdf);
    workspace::warn(cache.store_values(&key, &found.to_numbers(brdf.is_signed())).err());
    Ok(found)
}

/// One line each.
pub fn warnings(notation: &str, found: &Plausibility) -> Vec<String> {
    found.warnings.iter().map(|warning| format!("{}: {warning}", shown(notation, 200))).collect()
}

/// The albedo of each channel at each angle; `null` where nothing is measured.
pub fn albedo_json(found: &Plausibility) -> Value {
    let each = |a: &vernis_metric::brdf::plausibility::Albedo| {
        let rgb = (a.measured > 0.0).then_some(a.rgb);
        json!({"theta_deg": a.theta_deg, "rgb": rgb, "measured": a.measured})
    };
    found.albedo.iter().map(each).collect()
}

/// One line for each angle.
pub fn albedo_text(found: &Plausibility) -> String {
    found.albedo.iter().map(|a| format!("albedo for light at {:2} deg: {a}\n", a.theta_deg)).collect()
}
