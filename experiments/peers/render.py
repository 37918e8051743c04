"""Time for equal variance of `vernis render` and Mitsuba 3, on one core, in one run.

    pip install mitsuba numpy
    python experiments/peers/render.py VERNIS MESH.ply PROBE.hdr [--samples 64] [--seeds 4] [--variants scalar_rgb llvm_ad_rgb]

The scene is the Buddha (any mesh will do; it is put on the table, 2 high, with flat facets) on a Lambert table, seen as in
`crates/vernis-image/tests/it/render_golden.rs`: 64 x 96 pixels. Its BRDF is GGX, alpha 0.3, F = 1; both renderers sample light and BRDF.
For each renderer, direct light and 8 bounces: CPU time a sample of a pixel, variance of a pixel (mean over the film of the variance over
seeds), and time x variance: what a picture of a given noise costs. Both run on one thread, in turns, and the least time of each counts.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import tempfile
import time

import numpy as np

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("vernis")
parser.add_argument("mesh")
parser.add_argument("probe")
parser.add_argument("--samples", type=int, default=64)
parser.add_argument("--seeds", type=int, default=4)
parser.add_argument("--alpha", type=float, default=0.3)
parser.add_argument("--variants", nargs="*", default=["scalar_rgb", "llvm_ad_rgb"])
args = parser.parse_args()

WIDTH, HEIGHT, HALF_SIDE = 64, 96, 3.0
KD_TABLE = [0.42, 0.24, 0.11]


def ply(path):
    """Vertices and triangles of an ASCII PLY file."""
    lines = open(path).read().split("\n")
    end = lines.index("end_header")
    count = {m[1]: int(m[2]) for m in (re.match(r"element (\w+) (\d+)", x) for x in lines[:end]) if m}
    nv, nf = count["vertex"], count["face"]
    v = np.array([x.split()[:3] for x in lines[end + 1 : end + 1 + nv]], float)
    f = np.array([x.split()[1:4] for x in lines[end + 1 + nv : end + 1 + nv + nf]], int)
    return v, f


vertices, faces = ply(args.mesh)
low, high = vertices.min(0), vertices.max(0)
translate = [-(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2]
scale = 2 / (high[1] - low[1])
folder = tempfile.mkdtemp()


def vernis(bounces, seed):
    """A picture, and the CPU seconds of the rendering alone."""
    scene = {
        "shape": {"mesh": os.path.abspath(args.mesh), "translate": translate, "scale": scale, "normals": "face"},
        "brdf": {"model": "ggx", "kd": [0, 0, 0], "f0": [1, 1, 1], "alpha": args.alpha},
        "table": {"half_side": HALF_SIDE, "brdf": {"model": "lambert", "kd": KD_TABLE}},
        "camera": {"from": [0, 1, 6], "to": [0, 1, 0], "fov_deg": 24},
        "film": [WIDTH, HEIGHT],
        "light": os.path.abspath(args.probe),
        "bounces": bounces,
        "samples": args.samples,
        "seed": seed,
    }
    path, out = os.path.join(folder, "scene.json"), os.path.join(folder, "out.exr")
    open(path, "w").write(json.dumps(scene))

    def run(samples):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [args.vernis, "render", path, "--out", out, "--threads", "1", "--replace", "--samples", str(samples)]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        rays = re.search(r"([\d.]+) million rays", text)
        return after.ru_utime - before.ru_utime, float(rays[1])

    # What reading and building take is the time of one sample.
    start, _ = run(1)
    whole, rays = run(args.samples)
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return read(out), (whole - start) * args.samples / max(args.samples - 1, 1), rays, memory


def read(path):
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    return np.array(mi.Bitmap(path).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))


def mitsuba_scene(mi):
    v = (vertices + np.array(translate)) * scale
    mesh_path = os.path.join(folder, "mesh.ply")
    with open(mesh_path, "w") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(v)}\nproperty float x\nproperty float y\nproperty float z\n")
        file.write(f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
        file.writelines("%.9g %.9g %.9g\n" % tuple(p) for p in v)
        file.writelines("3 %d %d %d\n" % tuple(f) for f in faces)
    T = mi.ScalarTransform4f
    # The environment map interpolates between texels and has its own frame; neither changes what a sample costs.
    conductor = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": args.alpha}
    table = {"type": "twosided", "inner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": KD_TABLE}}}
    return lambda bounces: mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": 100, "hide_emitters": True},
            "sensor": {
                "type": "perspective",
                "fov": 24,
                "fov_axis": "y",
                "to_world": T().look_at(origin=[0, 1, 6], target=[0, 1, 0], up=[0, 1, 0]),
                "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
                "sampler": {"type": "independent", "sample_count": args.samples},
            },
            "light": {"type": "envmap", "filename": os.path.abspath(args.probe)},
            "shape": {"type": "ply", "filename": mesh_path, "face_normals": True, "bsdf": {"type": "twosided", "inner": conductor}},
            "table": {
                "type": "rectangle",
                "to_world": T().rotate([1, 0, 0], -90).scale(HALF_SIDE),
                "bsdf": table,
            },
        }
    )


def summary(name, bounces, pictures, seconds, extra=""):
    variance = float(np.mean(np.var(np.array(pictures, float), axis=0, ddof=1)))
    per_sample = min(seconds) / (WIDTH * HEIGHT * args.samples)
    print(
        f"{name:12} {bounces} bounces: {1e6 * per_sample:6.3f} us a sample, mean {np.mean(pictures):.4f}, "
        f"variance {variance:.3e}, time x variance {min(seconds) * variance:.3e} {extra}",
        flush=True,
    )
    return min(seconds) * variance


import mitsuba as mi  # noqa: E402

costs, own = {}, {}
# First, while Mitsuba still has threads to read our files with.
for bounces in (1, 8):
    found = [vernis(bounces, seed) for seed in range(args.seeds)]
    extra = f"({max(f[2] for f in found):.2f} million rays a second, peak {max(f[3] for f in found):.0f} MB)"
    own[bounces] = summary("vernis", bounces, [f[0] for f in found], [f[1] for f in found], extra)
for variant in args.variants:
    mi.set_variant(variant)
    if variant.startswith("llvm"):
        import drjit as dr

        dr.set_thread_count(1)
    make = mitsuba_scene(mi)
    for bounces in (1, 8):
        scene = make(bounces)
        mi.render(scene, spp=args.samples, seed=99)
        pictures, seconds = [], []
        for seed in range(args.seeds):
            started = time.process_time()
            picture = np.array(mi.render(scene, spp=args.samples, seed=seed))
            seconds.append(time.process_time() - started)
            pictures.append(picture)
        costs[variant, bounces] = summary(variant, bounces, pictures, seconds)
for variant in args.variants:
    for bounces in (1, 8):
        share = own[bounces] / costs[variant, bounces]
        print(f"{bounces} bounces: vernis takes {share:.2f} of the time of {variant} for equal variance")
