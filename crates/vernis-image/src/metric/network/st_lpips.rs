//! ST-LPIPS: LPIPS by networks that hardly notice a shift of a picture by a pixel.
//!
//!   ST-LPIPS(x, y) = sum over layers l of the mean over pixels of  sum over channels c of w_lc (f_lc(x) - f_lc(y))^2
//!
//! with the symbols of LPIPS ([`crate::metric::network::lpips`]). Networks and weights differ: where the original network takes every
//! second value (or every fourth in the first layer of AlexNet), this one reflects the picture by 2 pixels, blurs it by
//! (1 2 1)^T (1 2 1)/16 and then takes every second. Largest values of windows are taken at every pixel before that. The blur of
//! AlexNet's first layer comes before its ReLU.
//!
//! | name | network |
//! | --- | --- |
//! | `st-lpips-alex` | AlexNet |
//! | `st-lpips-vgg` | VGG-16 |
//!
//! Source: Ghildyal and Liu 2022 (doi:10.1007/978-3-031-19797-0_6). Agrees with the package `stlpips-pytorch` 0.0.2 within 1e-6. The
//! map is that of LPIPS.
//!
//! Weights: `alex_shift_tolerant.pth` and `vgg_shift_tolerant.pth`, complete, see [`crate::metric::WEIGHTS_FILES`]. None is shipped.
//!
//! Display: none; codes are taken as they are. Blind to: viewing distance, shifts by a pixel or two; light and colour are seen as far
//! as features for recognising objects depend on them.
//!
//! Memory: about 2 kB a pixel.

use super::layers::Layer;
use super::lpips::{ALEX, SMALLEST, VGG, VGG_BLOCKS};
use super::perceptual::{PerceptualNetwork, wanted_linear, wanted_network};
use super::tensors::Wanted;
use super::{loaded, tensors};
use crate::metric::contract::{Conditions, ImageMetric, Need, PreparedResult, Properties};
use crate::metric::weights::{Weights, WeightsError, WeightsFile};
use crate::picture::EncodedPicture;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// A network that tolerates shifts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShiftTolerant {
    /// AlexNet.
    Alex,
    /// VGG-16.
    Vgg,
}

/// ST-LPIPS on one network.
#[derive(Clone, Copy, Debug)]
pub struct StLpips(pub ShiftTolerant);

impl ImageMetric for StLpips {
    fn name(&self) -> &'static str {
        match self.0 {
            ShiftTolerant::Alex => "st-lpips-alex",
            ShiftTolerant::Vgg => "st-lpips-vgg",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            smallest: SMALLEST,
            most_pixels: 1 << 21,
            needs: vec![Need::Weights { files: self.files() }],
            ..Properties::new("ST-LPIPS", "1, from 0", "Ghildyal and Liu 2022, doi:10.1007/978-3-031-19797-0_6")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        loaded(self.name(), self.files(), conditions, |weights, files| self.load(weights, files))?.prepare(reference)
    }
}

impl StLpips {
    fn files(self) -> &'static [&'static str; 1] {
        match self.0 {
            ShiftTolerant::Alex => &["alex_shift_tolerant.pth"],
            ShiftTolerant::Vgg => &["vgg_shift_tolerant.pth"],
        }
    }

    fn load(self, weights: &Weights, files: &[&WeightsFile]) -> Result<PerceptualNetwork, WeightsError> {
        let (channels, layers) = match self.0 {
            ShiftTolerant::Alex => (&ALEX, alex()),
            ShiftTolerant::Vgg => (&VGG, vgg()),
        };
        let scaling = ["scaling_layer.shift", "scaling_layer.scale"];
        let mut wanted = scaling.map(|name| Wanted::new(name, [1, 3, 1, 1])).to_vec();
        wanted.extend(wanted_network(&layers));
        wanted.extend(wanted_linear(channels));
        let path = weights.checked(files[0])?;
        let mut all = tensors::read(&path, &wanted, |_| false)?;
        let [shift, scale] = scaling.map(|name| {
            let values = all.take(name);
            [values[0], values[1], values[2]]
        });
        if let Some(zero) = scale.iter().position(|v| *v == 0.0) {
            let reason = format!("number {zero} of tensor scaling_layer.scale is 0; it must not be");
            return Err(WeightsError::new(&path, reason));
        }
        let linear: Vec<Vec<f32>> = wanted_linear(channels).iter().map(|w| all.take(&w.name)).collect();
        let mut linear = linear.into_iter();
        Ok(PerceptualNetwork::new((shift, scale), &layers, &mut all, channels, |_| linear.next().unwrap_or_default()))
    }
}

fn name(slice: usize, index: usize) -> String {
    format!("net.slice{slice}.{index}")
}

fn conv(name: String, (from, to): (usize, usize), kernel: usize, padding: usize) -> Layer {
    Layer::Conv { name, from, to, kernel, stride: 1, padding }
}

fn blur(name: String, channels: usize) -> Layer {
    Layer::Blur { name, channels }
}

fn alex() -> Vec<Layer> {
    let pool = || Layer::MaxPool { kernel: 3, stride: 1, ceil: false };
    vec![
        conv(name(1, 0), (3, 64), 11, 2),
        blur(name(1, 1), 64),
        Layer::Relu,
        Layer::Tap,
        pool(),
        blur(name(2, 4), 64),
        conv(name(2, 5), (64, 192), 5, 2),
        Layer::Relu,
        Layer::Tap,
        pool(),
        blur(name(3, 8), 192),
        conv(name(3, 9), (192, 384), 3, 1),
        Layer::Relu,
        Layer::Tap,
        conv(name(4, 11), (384, 256), 3, 1),
        Layer::Relu,
        Layer::Tap,
        conv(name(5, 13), (256, 256), 3, 1),
        Layer::Relu,
        Layer::Tap,
    ]
}

fn vgg() -> Vec<Layer> {
    let mut layers = Vec::new();
    let (mut index, mut from) = (0, 3);
    for (block, channels) in VGG_BLOCKS.iter().enumerate() {
        let slice = block + 1;
        if block > 0 {
            layers.extend([Layer::MaxPool { kernel: 2, stride: 1, ceil: false }, blur(name(slice, index + 1), from)]);
            index += 2;
        }
        for to in *channels {
            layers.extend([conv(name(slice, index), (from, *to), 3, 1), Layer::Relu]);
            (index, from) = (index + 2, *to);
        }
        layers.push(Layer::Tap);
    }
    layers
}
