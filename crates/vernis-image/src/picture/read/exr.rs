//! OpenEXR: the channels R, G, B (or Y alone) of the first layer that has them, at full resolution. Values are cd/m2 with the
//! primaries of BT.709, which is what a file without the attribute `chromaticities` means.

use super::opaque;
use crate::picture::encoded::check_size;
use crate::picture::{EncodedPicture, Encoding, PictureError};
use exr::image::{AnyChannel, FlatSamples};
use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers};
use std::io::Cursor;

/// Primaries and white of BT.709: red, green, blue, white (x, y).
const BT709: [[f32; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];
/// Chromaticities of a file may be rounded.
const ROUNDING: f32 = 0.002;
/// Values of all channels of the largest layer that is read: a renderer writes normals, depth and the like beside RGB.
const MOST_VALUES: usize = 8 * crate::picture::MOST_PIXELS;

pub(super) fn decode(bytes: &[u8]) -> Result<EncodedPicture, PictureError> {
    let wrong = |reason: String| PictureError::Content { format: "OpenEXR", reason };
    let failed = |error: exr::error::Error| wrong(error.to_string());
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    for header in &meta.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
        let values = header.layer_size.area().saturating_mul(header.channels.list.len());
        if values > MOST_VALUES {
            let found = header.channels.list.len();
            let reason =
                format!("a layer has {found} channels, together {values} values; at most {MOST_VALUES} are read");
            return Err(wrong(reason));
        }
        primaries(header).map_err(wrong)?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    check_size(width, height)?;
    let channels = layer.channel_data.list;
    let named = |name: &str| channels.iter().find(|c| c.name.to_string() == name);
    let rgb = match (named("R"), named("G"), named("B"), named("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) => [y; 3],
        _ => {
            let names: Vec<_> = channels.iter().map(|c| c.name.to_string()).collect();
            return Err(wrong(format!("its channels are {}; it must have R, G and B, or Y", names.join(", "))));
        }
    };
    if let Some(alpha) = named("A") {
        opaque(&samples(alpha, width * height).map_err(wrong)?, width)?;
    }
    let [r, g, b] = rgb.map(|channel| samples(channel, width * height));
    let (r, g, b) = (r.map_err(wrong)?, g.map_err(wrong)?, b.map_err(wrong)?);
    let pixels = (0..width * height).map(|i| [r[i], g[i], b[i]]).collect();
    EncodedPicture::new(width, height, pixels, Encoding::Linear)
}

/// That the primaries are those of BT.709, or not said.
fn primaries(header: &Header) -> Result<(), String> {
    let Some(found) = header.shared_attributes.chromaticities else { return Ok(()) };
    let found = [found.red, found.green, found.blue, found.white].map(|p| [p.x(), p.y()]);
    let near = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).abs() <= ROUNDING && (a[1] - b[1]).abs() <= ROUNDING;
    if found.iter().zip(&BT709).all(|(a, b)| near(a, b)) {
        return Ok(());
    }
    Err(format!(
        "its primaries and white are {found:?} (x, y); they must be those of BT.709, {BT709:?}: convert the picture first"
    ))
}

fn samples(channel: &AnyChannel<FlatSamples>, count: usize) -> Result<Vec<f32>, String> {
    let values: Vec<f32> = match &channel.sample_data {
        FlatSamples::F16(values) => values.iter().map(|v| v.to_f32()).collect(),
        FlatSamples::F32(values) => values.clone(),
        FlatSamples::U32(_) => {
            return Err(format!("channel {} holds integers; it must hold half or float numbers", channel.name));
        }
    };
    if values.len() == count {
        return Ok(values);
    }
    Err(format!("channel {} has {} values for {count} pixels; it must have one a pixel", channel.name, values.len()))
}
