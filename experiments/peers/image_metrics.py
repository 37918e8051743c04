"""Times of metrics on pictures beside those of scikit-image, flip-evaluator, pycvvdp and PyTorch, in one run.

    pip install numpy pillow scikit-image flip-evaluator      # and cvvdp, which brings torch; networks need torch alone
    python experiments/peers/image_metrics.py [--size 580x900] [--runs 7] [--no-networks]

Makes a pair of pictures by formula, times each library on them in this process, then runs the example `time_metrics` of
`crates/vernis-image` in release mode, on one thread and on all. Times are medians and leave out the reading of files. What is not
installed is left out, and said. LPIPS, ST-LPIPS and MatSim run with weights by formula, PyTorch on one thread (networks.py); they take
most of the time, half an hour in all.
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
RGB601 = np.array([0.299, 0.587, 0.114])


def pictures(width, height):
    """Ramps, a chess board and texture; the same with noise."""
    y, x, c = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    reference = 20 + (3 * x + 2 * (c + 1) * y) % 150 + 60 * ((x // 16 + y // 16) % 2) + (x * x + 7 * y * (c + 1)) % 23
    noise = (x * 7919 + y * 104729 + c * 1299709 + x * y * 31) % 29 - 14
    return reference.astype(np.uint8), np.clip(reference + noise, 0, 255).astype(np.uint8)


def median_ms(run, runs):
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times)


def peers(reference, test, with_networks):
    """Name of ours, name of the peer, and a function to time; or why there is none."""
    try:
        from skimage.color import deltaE_ciede2000, rgb2lab
        from skimage.metrics import structural_similarity

        options = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=255)
        luma = [picture @ RGB601 for picture in (reference, test)]
        yield "ssim", "scikit-image", lambda: structural_similarity(*[picture @ RGB601 for picture in (reference, test)], **options)
        yield "ssim", "scikit-image, luma given", lambda: structural_similarity(*luma, **options)
        lab = lambda: [rgb2lab(picture) for picture in (reference, test)]
        yield "cielab", "scikit-image", lambda: np.sqrt(((np.subtract(*lab())) ** 2).sum(-1)).mean()
        yield "ciede2000", "scikit-image", lambda: deltaE_ciede2000(*lab()).mean()
    except ImportError as missing:
        print(f"left out: {missing}")
    try:
        import flip_evaluator

        unit = [np.ascontiguousarray(picture, dtype=np.float32) / 255 for picture in (reference, test)]
        yield "flip", "flip-evaluator", lambda: flip_evaluator.evaluate(*unit, "LDR", applyMagma=False)
    except ImportError as missing:
        print(f"left out: {missing}")
    try:
        import pycvvdp

        metric = pycvvdp.cvvdp(display_name="standard_fhd")
        yield "cvvdp", "pycvvdp", lambda: metric.predict(test, reference, dim_order="HWC")
    except ImportError as missing:
        print(f"left out: {missing}")
    if not with_networks:
        return
    try:
        import networks
        import torch

        torch.set_num_threads(1)
        for name, make in networks.NETWORKS.items():
            network, channels = make()
            networks.fill(network)
            yield name, "PyTorch, one thread", lambda: networks.lpips(network, channels, reference, test)
        network = networks.fill(networks.matsim()).double()
        both = lambda: [networks.embedding(network, picture) for picture in (reference, test)]
        yield "matsim", "PyTorch, one thread, f64", both
    except ImportError as missing:
        print(f"left out: {missing}")


def weights(folder):
    """Writes weights for our networks."""
    try:
        import networks

        networks.write(folder)
    except ImportError as missing:
        print(f"left out: {missing}")


def ours(folder, threads, runs):
    command = ["cargo", "run", "--quiet", "--release", "-p", "vernis-image", "--features", "networks", "--example", "time_metrics", "--"]
    pair = [str(folder / "reference.png"), str(folder / "test.png")]
    environment = dict(os.environ, VERNIS_WEIGHTS=str(folder))
    command += pair + [str(threads), str(runs)]
    found = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, env=environment)
    return json.loads(found.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="580x900", help="width x height in pixels")
    parser.add_argument("--runs", type=int, default=7, help="runs of which the median counts")
    parser.add_argument("--no-networks", dest="networks", action="store_false", help="leave out LPIPS, ST-LPIPS and MatSim")
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    reference, test = pictures(width, height)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        Image.fromarray(reference).save(folder / "reference.png")
        Image.fromarray(test).save(folder / "test.png")
        if arguments.networks:
            weights(folder)
        alone, together = (ours(folder, threads, arguments.runs) for threads in (1, 0))
    theirs = [(name, peer, median_ms(run, arguments.runs)) for name, peer, run in peers(reference, test, arguments.networks)]
    print(f"{width} x {height} pixels, median of {arguments.runs} runs, ms; all = {together['threads']} threads")
    print(f"{'metric':<18}{'one thread':>12}{'all':>10}  {'peer':<26}{'its time':>10}{'one/peer':>10}{'all/peer':>10}")
    for name, one in alone["milliseconds"].items():
        every = together["milliseconds"][name]
        rows = [row for row in theirs if row[0] == name] or [(name, "", None)]
        for _, peer, its in rows:
            ratios = f"{its:>10.1f}{one / its:>10.2f}{every / its:>10.2f}" if its else ""
            print(f"{name:<18}{one:>12.1f}{every:>10.1f}  {peer:<26}{ratios}")


if __name__ == "__main__":
    main()
