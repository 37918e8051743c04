"""Times of distances between BRDFs beside GeomLoss on the CPU and formulas in numpy, in one process on one thread.

    pip install ./python numpy geomloss torch
    python experiments/peers/distances.py [--grids 9x9x36] [--powers 2,1] [--runs 3]

The transport distance: GeomLoss's `tensorized` Sinkhorn divergence in f64, p = 2 and p = 1, of three channels of two GGX models on the
cells of a grid; its values are printed beside ours. It holds matrices of all pairs of cells: 15x15x60 cells take 8 GB and a quarter of an hour. Ours runs on the
same grids and on the study's 45x45x180, where GeomLoss has nothing to compare. Lp distances: the formula of the study on arrays of
90x90x180 cells that are there already, and ours on values at its nodes. Times are processor times, the least of the runs.
"""

from __future__ import annotations

import argparse
import os
import time

os.environ["RAYON_NUM_THREADS"] = "1"
for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np

import vernis

REFERENCE = dict(kd=[0.01, 0.01, 0.01], f0=[0.95, 0.64, 0.54], alpha=0.15)
CANDIDATE = dict(REFERENCE, alpha=0.2)
ALPHA, BLUR, SCALING = 0.1, 0.05, 0.8


def fastest(run, runs):
    """Seconds of the fastest run, and its result."""
    best, result = float("inf"), None
    for _ in range(runs):
        start = time.process_time()
        result = run()
        best = min(best, time.process_time() - start)
    return best, result


def ggx(shape, kd, f0, alpha):
    """f cos(theta_i) of Schlick's Fresnel term and Smith's separate shadowing at the centres of cells: [*shape, 3]."""
    spans = (np.pi / 2, np.pi / 2, 2 * np.pi)
    ti, to, phi = np.meshgrid(*[(np.arange(n) + 0.5) / n * span for n, span in zip(shape, spans)], indexing="ij")
    wi = np.stack([np.sin(ti), 0 * ti, np.cos(ti)])
    wo = np.stack([np.sin(to) * np.cos(phi), np.sin(to) * np.sin(phi), np.cos(to)])
    h = wi + wo
    h /= np.linalg.norm(h, axis=0)
    square = alpha * alpha
    d = square / (np.pi * (h[2] ** 2 * (square - 1) + 1) ** 2)
    g = [2 * w / (w + np.sqrt(square + (1 - square) * w * w)) for w in (wi[2], wo[2])]
    fresnel = np.array(f0) + (1 - np.array(f0)) * (1 - (wi * h).sum(0))[..., None] ** 5
    lobe = (d * g[0] * g[1] / (4 * wi[2] * wo[2]))[..., None] * fresnel
    return (np.array(kd) / np.pi + lobe) * wi[2][..., None]


def transport(grids, powers, runs):
    try:
        import torch
        from geomloss import SamplesLoss

        torch.set_num_threads(1)
    except ImportError as missing:
        print(f"GeomLoss is left out: {missing}")
        SamplesLoss = None
    for grid in [*grids, "45x45x180"]:
        shape = tuple(int(n) for n in grid.split("x"))
        for p in powers:
            metric = vernis.metric(f"ot[p={p},alpha={ALPHA},blur={BLUR},scaling={SCALING},gamma=1,grid={grid}]")
            seconds, value = fastest(lambda: metric(vernis.model("ggx", **REFERENCE), vernis.model("ggx", **CANDIDATE)), runs)
            line = f"ot, p = {p}, {grid:>10}: {seconds:9.3f} s, {value:.6f}"
            if SamplesLoss is not None and grid != "45x45x180":
                base = np.stack(np.meshgrid(*[ALPHA * (np.arange(n) + 0.5) / n for n in shape], indexing="ij"), -1).reshape(-1, 3)
                graph = lambda model, c: torch.tensor(np.c_[base, ggx(shape, **model)[..., c].reshape(-1) ** 0.25])
                pairs = [(graph(REFERENCE, c), graph(CANDIDATE, c)) for c in range(3)]
                loss = SamplesLoss("sinkhorn", p=p, blur=BLUR, scaling=SCALING, backend="tensorized")
                theirs, value = fastest(lambda: sum(float(loss(x, y)) for x, y in pairs), 1)
                line += f"; GeomLoss {theirs:9.3f} s, {value:.6f}; ours takes {seconds / theirs:.4f} of it"
            print(line)


def lp(runs):
    shape = (90, 90, 180)
    a, b = (ggx(shape, **model).clip(1e-6) for model in (REFERENCE, CANDIDATE))
    formulas = {
        "D4.Cl": lambda: np.sqrt(np.mean((a - b) ** 2)),
        "D4.Cl.CR": lambda: np.sqrt(np.mean((np.cbrt(a) - np.cbrt(b)) ** 2)),
        "D9.Cl": lambda: np.sqrt(np.mean((np.log(0.001 + a) - np.log(0.001 + b)) ** 2)),
    }
    for name, formula in formulas.items():
        prepared = vernis.metric(name).prepare(vernis.model("ggx", **REFERENCE))
        values = prepared.evaluate(vernis.model("ggx", **CANDIDATE))
        theirs, _ = fastest(formula, runs)
        ours, _ = fastest(lambda: prepared.distance(values), runs)
        share = (ours / values.size) / (theirs / a.size)
        print(f"{name:9}: numpy {1e9 * theirs / a.size:6.2f} ns a number, ours {1e9 * ours / values.size:6.2f}: {share:.2f} of it")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grids", default="9x9x36", help="grids of the transport distance, THETA_IxTHETA_OxPHI_D")
    parser.add_argument("--powers", default="2,1", help="p of the transport distance")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    transport(options.grids.split(","), [int(p) for p in options.powers.split(",")], options.runs)
    lp(options.runs)


if __name__ == "__main__":
    main()
