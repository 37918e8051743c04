"""LPIPS, ST-LPIPS and MatSim in PyTorch, with weights by formula: the values of `crates/vernis-image/tests/it/networks.rs`.

    pip install torch numpy pillow
    python experiments/peers/networks.py

Networks are written down from their papers, layer by layer, so that neither torchvision nor a weight is needed. Numbers of tensor p,
element k: splitmix64 of p 2^32 + k + 1 as r in -1 to 1; tensors of two and more dimensions r sqrt(6/fan_in), running_var 1 + 0.2 r,
running_mean 0.05 r, weights of one dimension 1 + 0.1 r, biases 0.05 r; linear layers of LPIPS their absolute values. p counts the
tensors of a network, and those of the linear layers, from 0.
"""

import json

import numpy as np
import torch
from PIL import Image
from torch import nn
from torch.nn import functional as F

SHIFT = torch.tensor([-0.030, -0.088, -0.188])[None, :, None, None]
SCALE = torch.tensor([0.458, 0.448, 0.450])[None, :, None, None]
VGG = [[64, 64], [128, 128], [256] * 3, [512] * 3, [512] * 3]


def formula(p, shape, kind):
    with np.errstate(over="ignore"):
        z = (np.uint64(p) * np.uint64(1 << 32) + np.arange(1, np.prod(shape) + 1, dtype=np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        z ^= z >> np.uint64(30)
        z *= np.uint64(0xBF58476D1CE4E5B9)
        z ^= z >> np.uint64(27)
        z *= np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    r = 2 * ((z >> np.uint64(11)).astype(np.float64) / 2.0**53) - 1
    if len(shape) > 1:
        values = r * np.sqrt(6 / np.prod(shape[1:]))
    else:
        values = {"running_var": 1 + 0.2 * r, "running_mean": 0.05 * r, "weight": 1 + 0.1 * r}.get(kind, 0.05 * r)
    return torch.tensor(values.reshape(shape), dtype=torch.float32)


def fill(network):
    """The network with weights by formula; filters of blurs are constants, and count for nothing."""
    names = [name for name in network.state_dict() if not name.endswith(("num_batches_tracked", "filter"))]
    with torch.no_grad():
        for p, name in enumerate(names):
            tensor = network.state_dict()[name]
            tensor.copy_(formula(p, tuple(tensor.shape), name.rsplit(".", 1)[-1]))
    return network.eval()


class Blur(nn.Module):
    def __init__(self, channels):
        super().__init__()
        side = torch.tensor([1.0, 2.0, 1.0])
        self.register_buffer("filter", (torch.outer(side, side) / 16).repeat(channels, 1, 1, 1))

    def forward(self, x):
        return F.conv2d(F.pad(x, (2, 2, 2, 2), mode="reflect"), self.filter, stride=2, groups=x.shape[1])


class Fire(nn.Module):
    def __init__(self, inputs, few, many):
        super().__init__()
        self.squeeze = nn.Conv2d(inputs, few, 1)
        self.expand1x1 = nn.Conv2d(few, many, 1)
        self.expand3x3 = nn.Conv2d(few, many, 3, padding=1)

    def forward(self, x):
        x = F.relu(self.squeeze(x))
        return torch.cat([F.relu(self.expand1x1(x)), F.relu(self.expand3x3(x))], 1)


class Tap(nn.Module):
    def forward(self, x):
        return x


def alex(shift_tolerant):
    def pool(channels):
        return [nn.MaxPool2d(3, 1), Blur(channels)] if shift_tolerant else [nn.MaxPool2d(3, 2)]

    first = [nn.Conv2d(3, 64, 11, 1, 2), Blur(64)] if shift_tolerant else [nn.Conv2d(3, 64, 11, 4, 2)]
    steps = first + [nn.ReLU(), Tap()] + pool(64) + [nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), Tap()] + pool(192)
    for inputs, outputs in [(192, 384), (384, 256), (256, 256)]:
        steps += [nn.Conv2d(inputs, outputs, 3, padding=1), nn.ReLU(), Tap()]
    return nn.Sequential(*steps), [64, 192, 384, 256, 256]


def vgg(shift_tolerant):
    steps, inputs = [], 3
    for block in VGG:
        if steps:
            steps += [nn.MaxPool2d(2, 1), Blur(inputs)] if shift_tolerant else [nn.MaxPool2d(2, 2)]
        for outputs in block:
            steps += [nn.Conv2d(inputs, outputs, 3, padding=1), nn.ReLU()]
            inputs = outputs
        steps.append(Tap())
    return nn.Sequential(*steps), [block[-1] for block in VGG]


def squeeze():
    def pool():
        return nn.MaxPool2d(3, 2, ceil_mode=True)

    steps = [nn.Conv2d(3, 64, 3, 2), nn.ReLU(), Tap(), pool(), Fire(64, 16, 64), Fire(128, 16, 64), Tap()]
    steps += [pool(), Fire(128, 32, 128), Fire(256, 32, 128), Tap(), pool(), Fire(256, 48, 192), Tap()]
    steps += [Fire(384, 48, 192), Tap(), Fire(384, 64, 256), Tap(), Fire(512, 64, 256), Tap()]
    return nn.Sequential(*steps), [64, 128, 256, 384, 384, 512, 512]


def features(network, picture):
    x = (torch.tensor(picture, dtype=torch.float32).permute(2, 0, 1)[None] / 255 * 2 - 1 - SHIFT) / SCALE
    found = []
    for step in network:
        x = step(x)
        if isinstance(step, Tap):
            found.append(x / (x.square().sum(1, keepdim=True).sqrt() + 1e-10))
    return found


def lpips(network, channels, reference, test):
    """The share of each layer."""
    with torch.no_grad():
        taps = zip(features(network, reference), features(network, test))
        weights = [formula(p, (1, n, 1, 1), "weight").abs() for p, n in enumerate(channels)]
        return [float(((a - b).square() * w).sum(1).mean()) for (a, b), w in zip(taps, weights)]


class Block(nn.Module):
    def __init__(self, inputs, outputs, stride):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        around = [nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)]
        self.downsample = nn.Sequential(*around) if stride > 1 else None

    def forward(self, x):
        y = self.bn2(self.conv2(F.relu(self.bn1(self.conv1(x)))))
        return F.relu(y + (self.downsample(x) if self.downsample else x))


def matsim():
    steps, inputs = [nn.Conv2d(3, 64, 7, 2, 3, bias=False), nn.BatchNorm2d(64), nn.ReLU(), nn.MaxPool2d(3, 2, 1)], 64
    for stage, (count, outputs) in enumerate([(3, 64), (4, 128), (6, 256), (3, 512)]):
        blocks = [Block(inputs, outputs, 2 if stage else 1)] + [Block(outputs, outputs, 1) for _ in range(count - 1)]
        steps.append(nn.Sequential(*blocks))
        inputs = outputs
    return nn.Sequential(*steps, nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(512, 128))


def embedding(network, picture):
    height, width, _ = picture.shape
    shorter = min(width, height)
    small = Image.fromarray(picture).resize((256 * width // shorter, 256 * height // shorter), Image.BILINEAR)
    left, top = round((small.width - 224) / 2), round((small.height - 224) / 2)
    middle = np.asarray(small.crop((left, top, left + 224, top + 224)), dtype=np.float64) / 255
    with torch.no_grad():
        return network(torch.tensor(middle).permute(2, 0, 1)[None])[0]


def pictures(width, height):
    """Ramps, a chess board and texture; the same with noise. As in image_metrics.py."""
    y, x, c = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    reference = 20 + (3 * x + 2 * (c + 1) * y) % 150 + 60 * ((x // 16 + y // 16) % 2) + (x * x + 7 * y * (c + 1)) % 23
    noise = (x * 7919 + y * 104729 + c * 1299709 + x * y * 31) % 29 - 14
    return reference.astype(np.uint8), np.clip(reference + noise, 0, 255).astype(np.uint8)


NETWORKS = {
    "lpips-alex": lambda: alex(False),
    "lpips-vgg": lambda: vgg(False),
    "lpips-squeeze": squeeze,
    "st-lpips-alex": lambda: alex(True),
    "st-lpips-vgg": lambda: vgg(True),
}


# Names of convolutions in the published files, in the order of the networks.
ALEX_NAMES = [f"features.{i}" for i in (0, 3, 6, 8, 10)]
VGG_NAMES = [f"features.{i}" for i in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)]
FIRES = [f"features.{i}.{part}" for i in (3, 4, 6, 7, 9, 10, 11, 12) for part in ("squeeze", "expand1x1", "expand3x3")]
ST_ALEX_NAMES = [f"net.slice{i}" for i in ("1.0", "2.5", "3.9", "4.11", "5.13")]
ST_VGG_NAMES = "1.0 1.2 2.6 2.8 3.12 3.14 3.16 4.20 4.22 4.24 5.28 5.30 5.32".split()
FILES = {
    "lpips-alex": ("alexnet-owt-7be5be79.pth", ALEX_NAMES, "alex.pth", []),
    "lpips-vgg": ("vgg16-397923af.pth", VGG_NAMES, "vgg.pth", []),
    "lpips-squeeze": ("squeezenet1_1-b8a52dc0.pth", ["features.0", *FIRES], "squeeze.pth", []),
    "st-lpips-alex": ("alex_shift_tolerant.pth", ST_ALEX_NAMES, None, ["1.1", "2.4", "3.8"]),
    "st-lpips-vgg": ("vgg_shift_tolerant.pth", [f"net.slice{i}" for i in ST_VGG_NAMES], None, ["2.5", "3.11", "4.19", "5.27"]),
}


def write(folder):
    """All networks by formula under the names and in the form of the published files."""
    for name, (file, convolutions, linear_file, blurs) in FILES.items():
        network, channels = NETWORKS[name]()
        state = fill(network).state_dict()
        numbers = [value for key, value in state.items() if not key.endswith("filter")]
        filters = [value for key, value in state.items() if key.endswith("filter")]
        keys = [f"{convolution}.{part}" for convolution in convolutions for part in ("weight", "bias")]
        tensors = dict(zip(keys, numbers, strict=True))
        tensors |= {f"net.slice{at}.filt": value for at, value in zip(blurs, filters, strict=True)}
        linear = {f"lin{p}.model.1.weight": formula(p, (1, n, 1, 1), "weight").abs() for p, n in enumerate(channels)}
        if linear_file:
            torch.save(linear, folder / linear_file)
        else:
            tensors |= {"scaling_layer.shift": SHIFT, "scaling_layer.scale": SCALE} | linear
        torch.save(tensors, folder / file)
    state = fill(matsim()).state_dict()
    tensors = {"fc." + key[3:] if key.startswith("10.") else f"new_model.{key}": value for key, value in state.items()}
    torch.save({"epoch": 0, "state_dict": tensors}, folder / "model_best.pth.tar")


def main():
    reference, test = pictures(67, 51)
    for name, make in NETWORKS.items():
        network, channels = make()
        print(json.dumps({name: lpips(fill(network), channels, reference, test)}))
    network = fill(matsim()).double()
    print(json.dumps({"matsim": float((embedding(network, reference) - embedding(network, test)).norm())}))


if __name__ == "__main__":
    main()
