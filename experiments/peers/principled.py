"""Values of Mitsuba's `principled` BSDF at 200 pairs of directions, for `crates/vernis-metric/tests/it/principled.rs`.

    pip install mitsuba
    python experiments/peers/principled.py > crates/vernis-metric/tests/it/principled_golden.json

The directions and the parameters are made here; every value is Mitsuba's, in single precision, divided by the cosine that its `eval`
includes.
"""

import json

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

NAMES = ["roughness", "metallic", "specular", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss"]
CASES = [
    {"base_color": [0.6, 0.3, 0.1], "roughness": 0.5},
    {"base_color": [0.9, 0.7, 0.3], "roughness": 0.3, "metallic": 1.0},
    {"base_color": [0.05, 0.4, 0.2], "roughness": 0.25, "specular": 0.9, "spec_tint": 0.7},
    {"base_color": [0.3, 0.1, 0.5], "roughness": 0.8, "sheen": 0.9, "sheen_tint": 0.6, "flatness": 0.5},
    {"base_color": [0.2, 0.2, 0.6], "roughness": 0.4, "clearcoat": 1.0, "clearcoat_gloss": 0.3},
    {"base_color": [0.7, 0.5, 0.2], "roughness": 0.45, "metallic": 0.6, "specular": 0.3, "clearcoat": 0.5, "clearcoat_gloss": 0.8},
    {"base_color": [0.0, 0.0, 0.0], "roughness": 0.6, "spec_tint": 0.5, "sheen": 0.4, "sheen_tint": 1.0},
    {"base_color": [0.0, 0.0, 0.0], "roughness": 0.5},
    {"base_color": [0.8, 0.35, 0.55], "roughness": 0.35, "metallic": 0.4, "specular": 0.7, "spec_tint": 0.3, "sheen": 0.5,
     "sheen_tint": 0.2, "flatness": 0.8, "clearcoat": 0.7, "clearcoat_gloss": 0.1},
]  # fmt: skip


def directions(count: int) -> np.ndarray:
    """Pairs above the horizon; every second one near the mirror direction, where the lobes are."""
    rng = np.random.default_rng(2012)
    theta_i, theta_o, phi = rng.uniform(0, 1.5, count), rng.uniform(0, 1.5, count), rng.uniform(0, 2 * np.pi, count)
    near = np.arange(count) % 2 == 1
    theta_o = np.where(near, np.clip(theta_i + rng.uniform(-0.15, 0.15, count), 0, 1.5), theta_o)
    phi = np.where(near, np.pi + rng.uniform(-0.2, 0.2, count), phi)
    first = np.stack([np.sin(theta_i), np.zeros(count), np.cos(theta_i)], axis=1)
    second = np.stack([np.sin(theta_o) * np.cos(phi), np.sin(theta_o) * np.sin(phi), np.cos(theta_o)], axis=1)
    return np.concatenate([first, second], axis=1)


def main() -> None:
    pairs = directions(200)
    cases = []
    for case in CASES:
        bsdf = {"type": "principled", "base_color": {"type": "rgb", "value": case["base_color"]}}
        bsdf |= {name: case[name] for name in NAMES if name in case}
        bsdf = mi.load_dict(bsdf)
        values = []
        for wi_x, wi_y, wi_z, wo_x, wo_y, wo_z in pairs:
            interaction = mi.SurfaceInteraction3f()
            interaction.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
            interaction.n = mi.Normal3f(0, 0, 1)
            # Mitsuba's wi is the viewer.
            interaction.wi = mi.Vector3f(wo_x, wo_y, wo_z)
            value = bsdf.eval(mi.BSDFContext(), interaction, mi.Vector3f(wi_x, wi_y, wi_z))
            values.append([float(f"{channel / wi_z:.7g}") for channel in value])
        cases.append({"parameters": case, "values": values})
    golden = {
        "origin": f"Mitsuba {mi.__version__}, variant scalar_rgb, by experiments/peers/principled.py",
        "directions": [[round(float(x), 9) for x in pair] for pair in pairs],
        "cases": cases,
    }
    print(json.dumps(golden, separators=(",", ":")))


main()
