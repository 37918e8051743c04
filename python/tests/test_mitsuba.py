"""The bridges to Mitsuba 3 and Dr.Jit, with the real packages. They need an LLVM of version 15 or later beside them."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

mi = pytest.importorskip("mitsuba", reason="mitsuba is not installed")


def _llvm_works() -> bool:
    """In a process of its own: an LLVM that is too old aborts."""
    code = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr\n"
        "x = dr.arange(mi.Float, 3); assert dr.sum(dr.maximum(x, mi.Float(1)))[0] == 4"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


if not _llvm_works():
    pytest.skip("no LLVM that Dr.Jit can use", allow_module_level=True)

mi.set_variant("llvm_ad_rgb")

import drjit as dr

import vernis
import vernis.drjit
import vernis.mitsuba

ETA, K = [0.2, 0.5, 1.3], [3.9, 2.4, 1.8]


def rgb(value: list[float]) -> dict:
    return {"type": "rgb", "value": value}


def test_a_rough_conductor_is_the_model_of_the_same_name() -> None:
    theirs = vernis.mitsuba.brdf({"type": "roughconductor", "distribution": "ggx", "alpha": 0.2, "eta": rgb(ETA), "k": rgb(K)})
    ours = vernis.model("ggx-conductor", kd=0, eta=ETA, k=K, alpha=0.2)
    wi, wo = vernis.Grid.standard(9, 9, 12).directions()
    np.testing.assert_allclose(theirs(wi, wo), ours(wi, wo), rtol=1e-5)
    assert vernis.metric("vernis-loss")(ours, theirs) < 1e-4


def test_the_light_and_the_viewer_are_not_exchanged() -> None:
    """The principled BSDF of Mitsuba is not reciprocal enough to hide an exchange in its diffuse part; a cosine is never left in."""
    bsdf = {"type": "diffuse", "reflectance": rgb([0.5, 0.25, 0.125])}
    wi, wo = vernis.Grid.standard(9, 9, 12).directions()
    np.testing.assert_allclose(vernis.mitsuba.brdf(bsdf)(wi, wo), np.tile([0.5, 0.25, 0.125], (len(wi), 1)) / np.pi, rtol=1e-5)


def test_xml_and_objects_are_sources_too() -> None:
    xml = '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>'
    up = [0.0, 0.0, 1.0]
    for source in (xml, mi.load_string(xml)):
        np.testing.assert_allclose(vernis.mitsuba.brdf(source)(up, up), [0.5 / np.pi] * 3, rtol=1e-5)
    with pytest.raises(vernis.InputError, match="BSDF"):
        vernis.mitsuba.brdf(3)


def test_a_scalar_variant_gives_the_same_values_and_a_spectral_one_is_refused() -> None:
    code = (
        "import numpy as np, mitsuba as mi, vernis, vernis.mitsuba\n"
        "bsdf = {'type': 'principled', 'roughness': 0.3, 'base_color': {'type': 'rgb', 'value': [0.6, 0.3, 0.1]}}\n"
        "directions = vernis.Grid.standard(4, 4, 6).directions(); found = []\n"
        "for variant in ('scalar_rgb', 'llvm_ad_rgb'):\n"
        "    mi.set_variant(variant); found.append(vernis.mitsuba.brdf(bsdf)(*directions))\n"
        "np.testing.assert_allclose(*found, rtol=1e-4)\n"
        "mi.set_variant('scalar_spectral')\n"
        "try: vernis.mitsuba.brdf(bsdf)\n"
        "except vernis.InputError as error: assert 'scalar_spectral' in str(error)\n"
        "else: raise AssertionError('a spectral variant was taken')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_measured_is_what_the_own_reader_reads(data) -> None:
    path = sorted((data / "rgl").glob("*_rgb.bsdf"))[0]
    theirs, ours = vernis.mitsuba.brdf({"type": "measured", "filename": str(path)}), vernis.open(path)
    other = vernis.model("ggx", kd=[0.05, 0.05, 0.05], f0=0.04, alpha=0.2)
    for name in ("vernis", "vernis-loss", "D4.Cl.CR"):
        metric = vernis.metric(name)
        assert metric(other, theirs) == pytest.approx(metric(other, ours), rel=1e-3)
        assert metric(theirs, other) == pytest.approx(metric(ours, other), rel=1e-3)


def test_a_principled_bsdf_is_fitted_to_a_target() -> None:
    target = {"type": "principled", "base_color": rgb([0.6, 0.3, 0.1]), "roughness": 0.32, "specular": 0.5}
    distance = vernis.drjit.Distance("vernis-loss", vernis.mitsuba.brdf(target))
    bsdf = mi.load_dict({**target, "base_color": rgb([0.4, 0.4, 0.4]), "roughness": 0.5})
    parameters = mi.traverse(bsdf)
    optimizer = mi.ad.Adam(lr=0.03)
    for name in ("base_color.value", "roughness.value"):
        optimizer[name] = parameters[name]
    best = (np.inf, None, None)
    for step in range(70):
        optimizer["roughness.value"] = dr.clip(optimizer["roughness.value"], 0.05, 1.0)
        optimizer["base_color.value"] = dr.clip(optimizer["base_color.value"], 0.01, 1.0)
        parameters.update(optimizer)
        loss = distance(bsdf)
        if loss[0] < best[0]:
            best = (loss[0], optimizer["roughness.value"][0], np.array(optimizer["base_color.value"]).ravel())
        dr.backward(loss)
        optimizer.step()
        optimizer.set_learning_rate(0.03 * 0.96**step)
    assert best[1] == pytest.approx(0.32, abs=0.01)
    np.testing.assert_allclose(best[2], [0.6, 0.3, 0.1], atol=0.01)


def test_both_modes_of_differentiation_agree() -> None:
    distance = vernis.drjit.Distance("vernis-loss", vernis.model("ggx", kd=0.2, f0=0.04, alpha=0.2))
    base = distance.prepared.evaluate(vernis.model("ggx", kd=0.1, f0=0.04, alpha=0.3))
    value, gradient = distance.prepared.value_and_grad(base.astype(np.float32))

    def scaled(factor):
        return mi.Color3f(*(mi.Float(np.ascontiguousarray(base[:, c])) * factor for c in range(3)))

    for mode in ("forward", "backward"):
        factor = mi.Float(1.0)
        dr.enable_grad(factor)
        found = distance(scaled(factor))
        assert found[0] == pytest.approx(value, rel=1e-5)
        slope = dr.forward_to(found) if mode == "forward" and dr.set_grad(factor, 1.0) is None else None
        if mode == "backward":
            dr.backward(found)
            slope = dr.grad(factor)
        assert slope[0] == pytest.approx(float(np.sum(gradient * base)), rel=1e-3)


def test_wrong_values_are_refused() -> None:
    distance = vernis.drjit.Distance("vernis-loss", vernis.model("lambert", kd=0.2))
    for wrong in (3, mi.Float([1.0, 2.0]), mi.Color3f(0.1)):
        with pytest.raises(vernis.InputError):
            distance(wrong)


def test_the_model_principled_is_that_of_mitsuba() -> None:
    rng = np.random.default_rng(7)
    wi, wo = vernis.Grid.standard(12, 12, 16).directions()
    chosen = rng.choice(len(wi), 200, replace=False)
    wi, wo = wi[chosen], wo[chosen]
    names = [p.name for p in next(m for m in vernis.models() if m.name == "principled").parameters if not p.name.startswith("base_color")]
    for _ in range(8):
        # Narrow lobes differ by Mitsuba's single precision.
        parameters = {name: float(rng.uniform(0.2 if name == "roughness" else 0.01, 1)) for name in names}
        parameters["clearcoat_gloss"] *= 0.5
        color = rng.uniform(0, 1, 3).tolist()
        theirs = vernis.mitsuba.brdf({"type": "principled", "base_color": rgb(color), **parameters})
        ours = vernis.model("principled", base_color=color, **parameters)
        np.testing.assert_allclose(ours(wi, wo), theirs(wi, wo), rtol=3e-3, atol=1e-5)


@pytest.mark.parametrize(
    "model",
    [
        vernis.model("lambert", kd=[0.6, 0.3, 0.1]),
        vernis.model("ggx-conductor", kd=0, eta=ETA, k=K, alpha=0.2),
        vernis.model("ggx", kd=0, f0=[0.9, 0.6, 0.3], alpha=0.15),
        vernis.model("ward-duer", kd=[0.2, 0.1, 0.05], ks=0.1, alpha=0.2),
    ],
    ids=lambda model: model.model,
)
def test_an_exported_material_looks_in_mitsuba_as_it_says(model) -> None:
    material = vernis.export(model, "mitsuba")
    for source in (material.dictionary, material.text):
        in_mitsuba = vernis.mitsuba.brdf(source)
        assert vernis.metric("vernis-loss")(material.brdf, in_mitsuba) < 1e-3
        assert vernis.metric("vernis-loss")(model, in_mitsuba) == pytest.approx(material.costs["vernis-loss"].distance, abs=1e-3)


def test_a_dictionary_and_a_fragment_of_xml_are_brdfs_wherever_one_is_asked_for() -> None:
    model = vernis.model("lambert", kd=0.5)
    dictionary = {"type": "diffuse", "reflectance": rgb([0.5, 0.5, 0.5])}
    xml = '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>'
    for source in (dictionary, xml):
        assert vernis.metric("D4.Cl")(model, source) < 1e-6
        assert vernis.compare(source, model, ["D1"])["D1"] < 1e-6
    assert vernis.fit(dictionary, "lambert", "D4.Cl").parameters["kd"] == pytest.approx([0.5] * 3, rel=1e-4)
