//! LPIPS: how far apart the features are that a network for recognising objects sees in two pictures.
//!
//!   LPIPS(x, y) = sum over layers l of the mean over pixels of  sum over channels c of w_lc (f_lc(x) - f_lc(y))^2
//!
//! f_lc: the features of layer l after its ReLU, divided by their length over the channels of the pixel (plus 1e-10); w_lc: weights,
//! at least 0, that were fitted to people's choices. A code v of a channel enters as (2 v/255 - 1 - shift)/scale with shift -0.030,
//! -0.088, -0.188 and scale 0.458, 0.448, 0.450 for red, green, blue.
//!
//! | name | network | layers |
//! | --- | --- | --- |
//! | `lpips-alex` | AlexNet | the five ReLU |
//! | `lpips-vgg` | VGG-16 | the last ReLU of each of the five blocks |
//! | `lpips-squeeze` | SqueezeNet 1.1 | the first ReLU, and the fire modules 2, 4, 5, 6, 7, 8 |
//!
//! Source: Zhang, Isola, Efros, Shechtman and Wang 2018, equation 1 (doi:10.1109/CVPR.2018.00068), version 0.1 of the weights. Agrees
//! with the package `lpips` 0.1.4 (PyTorch, on torchvision's networks filled by formula) within 1e-6; their trained weights were never at hand. The map is that of its option `spatial`: each
//! layer's differences, enlarged bilinearly to the size of the picture, and summed.
//!
//! Weights: the linear layers (`alex.pth`, `vgg.pth`, `squeeze.pth`) and the network of torchvision (`alexnet-owt-7be5be79.pth`,
//! `vgg16-397923af.pth`, `squeezenet1_1-b8a52dc0.pth`), see [`crate::metric::WEIGHTS_FILES`]. None is shipped.
//!
//! Display: none; codes are taken as they are. Blind to: viewing distance; light and colour are seen as far as features for
//! recognising objects depend on them.
//!
//! Memory: about 2 kB a pixel for VGG-16, 0.3 kB for the others.

use super::layers::Layer;
use super::perceptual::{PerceptualNetwork, wanted_linear, wanted_network};
use super::{loaded, tensors};
use crate::metric::contract::{Conditions, ImageMetric, Need, PreparedResult, Properties};
use crate::metric::weights::{Weights, WeightsError, WeightsFile};
use crate::picture::EncodedPicture;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Shift and scale of red, green and blue.
pub(super) const SCALING: ([f32; 3], [f32; 3]) = ([-0.030, -0.088, -0.188], [0.458, 0.448, 0.450]);

/// Smallest side of a picture, in pixels: AlexNet's last layer has one pixel there.
pub(super) const SMALLEST: usize = 32;

/// A network for recognising objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backbone {
    /// AlexNet.
    Alex,
    /// VGG-16.
    Vgg,
    /// SqueezeNet 1.1.
    Squeeze,
}

impl Backbone {
    /// Channels at the taps.
    fn channels(self) -> &'static [usize] {
        match self {
            Self::Alex => &ALEX,
            Self::Vgg => &VGG,
            Self::Squeeze => &[64, 128, 256, 384, 384, 512, 512],
        }
    }

    fn layers(self) -> Vec<Layer> {
        match self {
            Self::Alex => alex(),
            Self::Vgg => vgg(),
            Self::Squeeze => squeeze(),
        }
    }

    /// Linear layers and network.
    fn files(self) -> &'static [&'static str; 2] {
        match self {
            Self::Alex => &["alex.pth", "alexnet-owt-7be5be79.pth"],
            Self::Vgg => &["vgg.pth", "vgg16-397923af.pth"],
            Self::Squeeze => &["squeeze.pth", "squeezenet1_1-b8a52dc0.pth"],
        }
    }
}

/// Channels at the taps of AlexNet.
pub(super) const ALEX: [usize; 5] = [64, 192, 384, 256, 256];
/// Channels at the taps of VGG-16.
pub(super) const VGG: [usize; 5] = [64, 128, 256, 512, 512];

/// LPIPS on one network.
#[derive(Clone, Copy, Debug)]
pub struct Lpips(pub Backbone);

impl ImageMetric for Lpips {
    fn name(&self) -> &'static str {
        match self.0 {
            Backbone::Alex => "lpips-alex",
            Backbone::Vgg => "lpips-vgg",
            Backbone::Squeeze => "lpips-squeeze",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            smallest: SMALLEST,
            most_pixels: if self.0 == Backbone::Vgg { 1 << 21 } else { 1 << 23 },
            needs: vec![Need::Weights { files: self.0.files() }],
            ..Properties::new("LPIPS", "1, from 0", "Zhang et al. 2018, doi:10.1109/CVPR.2018.00068")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        loaded(self.name(), self.0.files(), conditions, |weights, files| self.load(weights, files))?.prepare(reference)
    }
}

impl Lpips {
    fn load(self, weights: &Weights, files: &[&WeightsFile]) -> Result<PerceptualNetwork, WeightsError> {
        let (channels, layers) = (self.0.channels(), self.0.layers());
        let mut linear = tensors::read(&weights.checked(files[0])?, &wanted_linear(channels), |_| false)?;
        // The part that names objects is in the file too.
        let classifier = |name: &str| name.starts_with("classifier.");
        let mut network = tensors::read(&weights.checked(files[1])?, &wanted_network(&layers), classifier)?;
        Ok(PerceptualNetwork::new(SCALING, &layers, &mut network, channels, |name| linear.take(name)))
    }
}

fn conv(index: usize, (from, to): (usize, usize), kernel: usize, stride: usize, padding: usize) -> Layer {
    Layer::Conv { name: format!("features.{index}"), from, to, kernel, stride, padding }
}

fn pool(ceil: bool) -> Layer {
    Layer::MaxPool { kernel: 3, stride: 2, ceil }
}

/// Krizhevsky 2014, arXiv:1404.5997, as in torchvision.
fn alex() -> Vec<Layer> {
    vec![
        conv(0, (3, 64), 11, 4, 2),
        Layer::Relu,
        Layer::Tap,
        pool(false),
        conv(3, (64, 192), 5, 1, 2),
        Layer::Relu,
        Layer::Tap,
        pool(false),
        conv(6, (192, 384), 3, 1, 1),
        Layer::Relu,
        Layer::Tap,
        conv(8, (384, 256), 3, 1, 1),
        Layer::Relu,
        Layer::Tap,
        conv(10, (256, 256), 3, 1, 1),
        Layer::Relu,
        Layer::Tap,
    ]
}

/// Channels of the convolutions of each block of VGG-16 (Simonyan and Zisserman 2015, arXiv:1409.1556, column D).
pub(super) const VGG_BLOCKS: [&[usize]; 5] = [&[64, 64], &[128, 128], &[256; 3], &[512; 3], &[512; 3]];

fn vgg() -> Vec<Layer> {
    let mut layers = Vec::new();
    let (mut index, mut from) = (0, 3);
    for (block, channels) in VGG_BLOCKS.iter().enumerate() {
        if block > 0 {
            layers.push(Layer::MaxPool { kernel: 2, stride: 2, ceil: false });
            index += 1;
        }
        for to in *channels {
            layers.extend([conv(index, (from, *to), 3, 1, 1), Layer::Relu]);
            (index, from) = (index + 2, *to);
        }
        layers.push(Layer::Tap);
    }
    layers
}

/// Iandola et al. 2016, arXiv:1602.07360, version 1.1 as in torchvision.
fn squeeze() -> Vec<Layer> {
    let fire = |index: usize, from: usize, squeeze: usize, expand: usize| Layer::Fire {
        name: format!("features.{index}"),
        from,
        squeeze,
        expand,
    };
    vec![
        conv(0, (3, 64), 3, 2, 0),
        Layer::Relu,
        Layer::Tap,
        pool(true),
        fire(3, 64, 16, 64),
        fire(4, 128, 16, 64),
        Layer::Tap,
        pool(true),
        fire(6, 128, 32, 128),
        fire(7, 256, 32, 128),
        Layer::Tap,
        pool(true),
        fire(9, 256, 48, 192),
        Layer::Tap,
        fire(10, 384, 48, 192),
        Layer::Tap,
        fire(11, 384, 64, 256),
        Layer::Tap,
        fire(12, 512, 64, 256),
        Layer::Tap,
    ]
}
