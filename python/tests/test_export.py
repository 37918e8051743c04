"""Materials of renderers: exact counterparts, nearest materials, what they cost, and files that the renderers' own readers take."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree

import pytest

import vernis

RENDERERS = ["mitsuba", "pbrt", "materialx", "gltf"]


@pytest.fixture(scope="module")
def gold() -> vernis.Brdf:
    return vernis.model("ggx-conductor", kd=0, eta=[0.16, 0.42, 1.45], k=[3.9, 2.4, 1.8], alpha=0.1)


def test_an_exact_counterpart_costs_nothing(gold) -> None:
    material = vernis.export(gold, "mitsuba")
    assert material.exact and material.model == "ggx-conductor" and material.parameters == gold.parameters
    assert set(material.costs) == {"vernis-loss", "vernis"}
    assert material.costs["vernis-loss"].distance == 0
    # Identical BRDFs get what people gave to hidden references.
    assert material.costs["vernis"].mos == vernis.metric("vernis").score(gold, gold).mos
    assert material.dictionary["type"] == "roughconductor" and material.dictionary["eta"] == {"type": "rgb", "value": [0.16, 0.42, 1.45]}
    assert "exact" in repr(material) and "<img" in material._repr_html_()


@pytest.mark.parametrize("renderer", RENDERERS)
def test_the_nearest_material_of_a_fit_says_what_it_costs(renderer: str, plastic, tmp_path) -> None:
    fit = vernis.fit(plastic, "ward-duer", "D4.Cl", max_evaluations=60)
    material = fit.material(renderer)
    assert not material.exact and set(material.costs) == {"D4.Cl", "vernis-loss", "vernis"}
    score = material.costs["vernis"]
    assert score.low <= score.mos <= score.high and score.mos > 3
    # The cost is that of the material itself.
    assert score.distance == vernis.metric("vernis")(fit.brdf, material.brdf)
    assert material.costs["D4.Cl"].distance == vernis.metric("D4.Cl")(fit.brdf, material.brdf)
    assert f"{score.mos:.2f} of 5" in material.text and "ward-duer of" in material.text
    suffix = {"mitsuba": ".xml", "pbrt": ".pbrt", "materialx": ".mtlx", "gltf": ".gltf"}[renderer]
    material.save(tmp_path / f"m{suffix}")
    assert (tmp_path / f"m{suffix}").read_text() == material.text
    with pytest.raises(vernis.InputError, match=suffix):
        material.save(tmp_path / "m.txt")
    assert fit.material(renderer) is material


def test_files_are_those_of_the_program(program, plastic, tmp_path) -> None:
    plastic.save(tmp_path / "plastic.json")
    fit = vernis.fit(tmp_path / "plastic.json", "ggx", max_evaluations=60)
    arguments = ["fit", tmp_path / "plastic.json", "--model", "ggx", "--max-evaluations", 60, "--export", ",".join(RENDERERS)]
    program(*arguments, "--out", tmp_path / "f.json", code=0 if fit.converged else 3)
    assert (tmp_path / "f.mtlx").read_text() == fit.to_materialx()
    assert (tmp_path / "f.pbrt").read_text() == fit.to_pbrt()
    assert (tmp_path / "f.xml").read_text() == fit.material("mitsuba").text
    assert json.loads((tmp_path / "f.gltf").read_text()) == fit.to_gltf()
    stored = json.loads((tmp_path / "f.json").read_text())["exports"]
    assert [export["renderer"] for export in stored] == RENDERERS
    assert stored[0]["file"] == "f.xml" and stored[0]["model"] == "principled"
    costs = {cost["metric"]["name"]: cost for cost in stored[0]["costs"]}
    assert costs["vernis"]["score"]["mos"] == fit.material("mitsuba").costs["vernis"].mos
    assert vernis.open(tmp_path / "f.json").parameters == fit.parameters


def test_xml_and_json_are_well_formed_whatever_the_name_of_the_reference() -> None:
    evil = vernis.Brdf.from_function(lambda wi, wo: 0 * wi + 0.1, 'a ---> b\n<bsdf/> "quoted" ]]>')
    fit = vernis.fit(evil, "lambert", "D4.Cl.CR")
    assert fit.material("mitsuba").exact
    root = ElementTree.fromstring(fit.material("mitsuba").text)
    assert root.tag == "bsdf" and root.attrib["type"] == "diffuse" and len(root) == 1
    assert ElementTree.fromstring(fit.to_materialx()).tag == "materialx"
    assert fit.to_gltf()["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0
    assert all(line.startswith(("#", "MakeNamedMaterial", "    ")) for line in fit.to_pbrt().splitlines())


def test_wrong_requests_are_refused(gold) -> None:
    with pytest.raises(vernis.UnknownNameError, match="unknown renderer `mitsubba`; did you mean mitsuba") as raised:
        vernis.export(gold, "mitsubba")
    assert raised.value.nearest == ["mitsuba"]
    with pytest.raises(vernis.InputError, match="only models can be translated"):
        vernis.export(lambda wi, wo: 0 * wi, "gltf")
    with pytest.raises(vernis.InputError, match="renderer is a int"):
        vernis.export(gold, 3)
    with pytest.raises(vernis.UnknownNameError):
        vernis.export(gold, "gltf", "D44")


def test_materialx_takes_the_document(plastic) -> None:
    mx = pytest.importorskip("MaterialX", reason="materialx is not installed")
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    metal = vernis.model("ggx", kd=0, f0=[0.9, 0.6, 0.3], alpha=0.1)
    for model in (plastic, metal, vernis.model("lambert", kd=0.4)):
        document = mx.createDocument()
        mx.readFromXmlString(document, vernis.export(model, "materialx").text)
        document.setDataLibrary(library)
        valid, message = document.validate()
        assert valid, message
        surface = document.getNode("vernis_surface")
        assert surface.getNodeDef() is not None and surface.getCategory() == "open_pbr_surface"
        # Every input is one of the shader, of its type.
        for entry in surface.getInputs():
            assert surface.getNodeDef().getInput(entry.getName()).getType() == entry.getType()
