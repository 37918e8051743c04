//! Networks with weights by formula, written as safetensors files: what `experiments/peers/networks.py` describes.

use safetensors::tensor::{Dtype, TensorView, serialize_to_file};
use std::path::Path;

/// A tensor: name, shape, numbers.
pub struct Tensor {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

/// Numbers of tensor `p`; the last part of its name and its shape say which.
fn numbers(p: u64, name: &str, shape: &[usize]) -> Vec<f32> {
    let fan_in: usize = shape[1..].iter().product();
    let kind = name.rsplit('.').next().expect("a name");
    let number = |k: u64| {
        let mut z = ((p << 32) + k + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        let r = 2.0 * ((z >> 11) as f64 / 2f64.powi(53)) - 1.0;
        let value = match (shape.len(), kind) {
            (2.., _) => r * (6.0 / fan_in as f64).sqrt(),
            (_, "running_var") => 1.0 + 0.2 * r,
            (_, "running_mean") => 0.05 * r,
            (_, "weight") => 1.0 + 0.1 * r,
            _ => 0.05 * r,
        };
        value as f32
    };
    let count: usize = shape.iter().product();
    (0..count as u64).map(number).collect()
}

/// Tensors of these names and shapes, in their order.
pub fn tensors(names: Vec<(String, Vec<usize>)>) -> Vec<Tensor> {
    let one = |(p, (name, shape)): (usize, (String, Vec<usize>))| {
        let values = numbers(p as u64, &name, &shape);
        Tensor { name, shape, values }
    };
    names.into_iter().enumerate().map(one).collect()
}

/// Linear layers of LPIPS: nothing negative.
pub fn linear(channels: &[usize]) -> Vec<Tensor> {
    let names = channels.iter().enumerate().map(|(i, n)| (format!("lin{i}.model.1.weight"), vec![1, *n, 1, 1]));
    let mut all = tensors(names.collect());
    all.iter_mut().flat_map(|tensor| &mut tensor.values).for_each(|v| *v = v.abs());
    all
}

fn conv(name: &str, to: usize, from: usize, kernel: usize) -> [(String, Vec<usize>); 2] {
    [(format!("{name}.weight"), vec![to, from, kernel, kernel]), (format!("{name}.bias"), vec![to])]
}

const ALEX: [(usize, usize, usize); 5] = [(64, 3, 11), (192, 64, 5), (384, 192, 3), (256, 384, 3), (256, 256, 3)];

/// torchvision's AlexNet, its features.
pub fn alexnet() -> Vec<Tensor> {
    let places = [0, 3, 6, 8, 10].into_iter().zip(ALEX);
    tensors(places.flat_map(|(i, (to, from, kernel))| conv(&format!("features.{i}"), to, from, kernel)).collect())
}

/// Places of VGG-16's convolutions among its features, with channels after and before.
const VGG: [(usize, usize, usize); 13] = [
    (0, 64, 3),
    (2, 64, 64),
    (5, 128, 64),
    (7, 128, 128),
    (10, 256, 128),
    (12, 256, 256),
    (14, 256, 256),
    (17, 512, 256),
    (19, 512, 512),
    (21, 512, 512),
    (24, 512, 512),
    (26, 512, 512),
    (28, 512, 512),
];

/// torchvision's VGG-16, its features.
pub fn vgg16() -> Vec<Tensor> {
    tensors(VGG.into_iter().flat_map(|(i, to, from)| conv(&format!("features.{i}"), to, from, 3)).collect())
}

/// torchvision's SqueezeNet 1.1, its features.
pub fn squeezenet() -> Vec<Tensor> {
    let mut names = conv("features.0", 64, 3, 3).to_vec();
    let fires = [
        (3, 64, 16, 64),
        (4, 128, 16, 64),
        (6, 128, 32, 128),
        (7, 256, 32, 128),
        (9, 256, 48, 192),
        (10, 384, 48, 192),
        (11, 384, 64, 256),
        (12, 512, 64, 256),
    ];
    for (i, from, few, many) in fires {
        names.extend(conv(&format!("features.{i}.squeeze"), few, from, 1));
        names.extend(conv(&format!("features.{i}.expand1x1"), many, few, 1));
        names.extend(conv(&format!("features.{i}.expand3x3"), many, few, 3));
    }
    tensors(names)
}

/// A complete ST-LPIPS network: convolutions and linear layers by formula, blurs and scaling as they are.
fn shift_tolerant(convs: Vec<(String, Vec<usize>)>, blurs: &[(&str, usize)], channels: &[usize]) -> Vec<Tensor> {
    let mut all = tensors(convs);
    let side = [1.0, 2.0, 1.0];
    all.extend(blurs.iter().map(|(name, channels)| {
        let filter: Vec<f32> = side.iter().flat_map(|a| side.map(|b| a * b / 16.0)).collect();
        Tensor { name: format!("{name}.filt"), shape: vec![*channels, 1, 3, 3], values: filter.repeat(*channels) }
    }));
    let scaling = [("shift", [-0.030, -0.088, -0.188]), ("scale", [0.458, 0.448, 0.450])];
    all.extend(scaling.map(|(name, values)| Tensor {
        name: format!("scaling_layer.{name}"),
        shape: vec![1, 3, 1, 1],
        values: values.to_vec(),
    }));
    all.extend(linear(channels));
    all
}

pub fn shift_tolerant_alex() -> Vec<Tensor> {
    let names = ["net.slice1.0", "net.slice2.5", "net.slice3.9", "net.slice4.11", "net.slice5.13"];
    let convs = names.into_iter().zip(ALEX).flat_map(|(name, (to, from, kernel))| conv(name, to, from, kernel));
    let blurs = [("net.slice1.1", 64), ("net.slice2.4", 64), ("net.slice3.8", 192)];
    shift_tolerant(convs.collect(), &blurs, &[64, 192, 384, 256, 256])
}

pub fn shift_tolerant_vgg() -> Vec<Tensor> {
    let places = ["1.0", "1.2", "2.6", "2.8", "3.12", "3.14", "3.16", "4.20", "4.22", "4.24", "5.28", "5.30", "5.32"];
    let convs =
        places.into_iter().zip(VGG).flat_map(|(at, (_, to, from))| conv(&format!("net.slice{at}"), to, from, 3));
    let blurs = [("net.slice2.5", 64), ("net.slice3.11", 128), ("net.slice4.19", 256), ("net.slice5.27", 512)];
    shift_tolerant(convs.collect(), &blurs, &[64, 128, 256, 512, 512])
}

/// MatSim's network, with the layer that its training alone needed.
pub fn matsim() -> Vec<Tensor> {
    let mut names = vec![];
    let normalised = |names: &mut Vec<(String, Vec<usize>)>, conv: String, norm: String, shape: [usize; 4]| {
        names.push((format!("{conv}.weight"), shape.to_vec()));
        let parts = ["weight", "bias", "running_mean", "running_var"];
        names.extend(parts.map(|part| (format!("{norm}.{part}"), vec![shape[0]])));
    };
    normalised(&mut names, "new_model.0".into(), "new_model.1".into(), [64, 3, 7, 7]);
    let mut from = 64;
    for (stage, (blocks, to)) in [(3, 64), (4, 128), (6, 256), (3, 512)].into_iter().enumerate() {
        for block in 0..blocks {
            let name = |part: &str| format!("new_model.{}.{block}.{part}", stage + 4);
            normalised(&mut names, name("conv1"), name("bn1"), [to, from, 3, 3]);
            normalised(&mut names, name("conv2"), name("bn2"), [to, to, 3, 3]);
            if stage > 0 && block == 0 {
                normalised(&mut names, name("downsample.0"), name("downsample.1"), [to, from, 1, 1]);
            }
            from = to;
        }
    }
    names.extend([("fc.weight".to_owned(), vec![128, 512]), ("fc.bias".to_owned(), vec![128])]);
    names.extend([("fc2.weight".to_owned(), vec![100, 128]), ("fc2.bias".to_owned(), vec![100])]);
    tensors(names)
}

/// Writes tensors as a safetensors file.
pub fn write(path: &Path, tensors: &[Tensor]) {
    let bytes: Vec<Vec<u8>> =
        tensors.iter().map(|tensor| tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let views = tensors.iter().zip(&bytes).map(|(tensor, bytes)| {
        (tensor.name.as_str(), TensorView::new(Dtype::F32, tensor.shape.clone(), bytes).expect("a view"))
    });
    serialize_to_file(views, None, path).expect("written");
}
