"""Metrics: the program's numbers, gradients, batches, and what is refused."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

import vernis

METRICS = ["vernis", "vernis-loss", "vernis-1", "D9.Cl", "D4.Cl.CR", "lab", "ot", "energy"]


def test_numbers_are_those_of_the_program_to_the_last_bit(program, plastic, rougher, tmp_path) -> None:
    plastic.save(tmp_path / "a.json")
    rougher.save(tmp_path / "b.json")
    named = [word for metric in METRICS for word in ("--metric", metric)]
    expected = json.loads(program("compare", tmp_path / "a.json", tmp_path / "b.json", *named, "--json"))
    assert vernis.compare(tmp_path / "a.json", tmp_path / "b.json", METRICS) == expected["distances"]
    for name in METRICS:
        metric = vernis.metric(name)
        assert metric(plastic, rougher) == expected["distances"][name]
        assert metric.version == expected["versions"][name]
    said, score = expected["mos"]["vernis"], vernis.metric("vernis").score(plastic, rougher)
    assert (score.mos, score.low, score.high) == (said["mos"], said["low"], said["high"])
    assert score.scale == (1.0, 5.0) and float(score) == score.distance
    assert "predicted MOS" in score._repr_html_() and score._repr_html_().count("<img") == 2


def test_identical_is_zero_and_groups_have_their_members(plastic) -> None:
    found = vernis.compare(plastic, plastic, ["all-lp", "vernis", "ot", "energy"])
    assert len(found) == 39 and set(found.values()) == {0.0}


def test_every_metric_says_what_it_is() -> None:
    found = vernis.metrics()
    assert set(METRICS) <= set(found)
    for name in METRICS:
        metric = vernis.metric(name)
        assert metric.lower_is_better and metric.version == found[name]["version"] and metric.unit == found[name]["unit"]
        assert metric.name in metric.quote() and metric.version in metric.quote() and vernis.__version__ in metric.quote()
        assert metric.summary and metric.source
    assert not vernis.metric("vernis").synthetic
    assert vernis.quote() == vernis.metric("vernis").quote()


@pytest.mark.parametrize("name", ["vernis", "vernis-loss", "D4.Cl.CR", "ot"])
def test_the_gradient_agrees_with_central_differences(name: str, plastic, rougher) -> None:
    prepared = vernis.metric(name).prepare(plastic)
    nodes = prepared.nodes
    assert nodes.wi.shape == nodes.wo.shape == (len(nodes), 3) and not nodes.wi.flags.writeable
    values = prepared.evaluate(rougher)
    value, gradient = prepared.value_and_grad(values)
    assert value == pytest.approx(prepared.distance(values), rel=1e-12)
    assert gradient.shape == values.shape and np.isfinite(gradient).all()
    change = values * np.random.default_rng(2).uniform(-1.0, 1.0, size=(1, 3))
    step = 1e-4 if name == "ot" else 1e-5
    slope = (prepared.distance(values + step * change) - prepared.distance(values - step * change)) / (2 * step)
    assert np.sum(gradient * change) == pytest.approx(slope, rel=2e-3 if name == "ot" else 1e-4)


def test_the_gradient_is_finite_at_identity(plastic) -> None:
    for name in ("vernis", "vernis-loss", "D4.Cl.CR"):
        prepared = vernis.metric(name).prepare(plastic)
        value, gradient = prepared.value_and_grad(prepared.evaluate(plastic))
        assert value == 0.0 and np.isfinite(gradient).all()


def test_what_a_fit_minimises_has_its_own_gradient(plastic, rougher) -> None:
    classical = vernis.metric("D4.Cl.CR").prepare(plastic)
    values = classical.evaluate(rougher)
    assert classical.value_and_grad(values, as_loss=True)[0] == classical.value_and_grad(values)[0]
    prepared = vernis.metric("vernis").prepare(plastic)
    values = prepared.evaluate(rougher)
    value, gradient = prepared.value_and_grad(values, as_loss=True)
    assert value != prepared.distance(values)
    ends = [prepared.value_and_grad(values * (1 + step), as_loss=True)[0] for step in (1e-5, -1e-5)]
    assert np.sum(gradient * values) == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4)


def test_batches_are_the_single_distances_and_tell_their_progress(plastic, rougher) -> None:
    prepared = vernis.metric("vernis").prepare(plastic)
    values = np.stack([prepared.evaluate(b) for b in (plastic, rougher)] * 3)
    told = []
    found = prepared.distances(values, progress=lambda stage, done, total: told.append((stage, done, total)))
    assert found.dtype == np.float64
    assert found.tolist() == [prepared.distance(v) for v in values] == [prepared.distance(b) for b in (plastic, rougher)] * 3
    assert prepared.distances(np.asfortranarray(values)).tolist() == found.tolist()
    assert prepared.distances(values[:0]).shape == (0,)
    assert told[-1] == ("distances", 6, 6)
    with pytest.raises(RuntimeError, match="enough"):
        prepared.distances(np.repeat(values, 40, axis=0), progress=_stop)


def _stop(stage: str, done: int, total: int) -> None:
    raise RuntimeError("enough")


def test_values_of_float32_are_taken(plastic, rougher) -> None:
    prepared = vernis.metric("vernis-loss").prepare(plastic)
    values = prepared.evaluate(rougher)
    assert prepared.distance(values.astype(np.float32)) == pytest.approx(prepared.distance(values), rel=1e-5)


def test_prepared_metrics_pickle(plastic, rougher) -> None:
    prepared = vernis.metric("vernis-loss").prepare(plastic)
    assert pickle.loads(pickle.dumps(prepared)).distance(rougher) == prepared.distance(rougher)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (lambda v: v[:7], "shape"),
        (lambda v: v.reshape(-1), "shape"),
        (lambda v: v[None], "one candidate"),
        (lambda v: v.astype(complex), "complex128"),
        (lambda v: v.astype(str), "dtype"),
        (lambda v: -v, "not negative"),
        (lambda v: np.where(np.arange(len(v))[:, None] == 9, np.nan, v), "node 9 .*NaN"),
        (lambda v: np.where(np.arange(len(v))[:, None] == 9, np.inf, v), "node 9"),
    ],
)
def test_wrong_values_are_refused(values, said: str, plastic) -> None:
    prepared = vernis.metric("vernis").prepare(plastic)
    wrong = values(prepared.evaluate(plastic))
    for use in (prepared.value_and_grad, prepared.distance):
        with pytest.raises(vernis.InputError, match=said):
            use(wrong)
    if wrong.ndim == 2 and wrong.shape == prepared.nodes.wi.shape:
        good = prepared.evaluate(plastic)
        with pytest.raises(vernis.InputError, match=said if wrong.dtype.kind != "f" else "member 1 of the batch"):
            prepared.distances([good, wrong])


def test_a_metric_without_a_gradient_says_so(plastic) -> None:
    metric = vernis.metric("vernis-1")
    assert not metric.differentiable or metric.prepare(plastic).nodes
    without = next(m for m, p in vernis.metrics().items() if not p["differentiable"])
    with pytest.raises(vernis.InputError, match="gradient"):
        prepared = vernis.metric(without).prepare(plastic)
        prepared.value_and_grad(np.ones((1, 3)))


def test_scoring_takes_rows_columns_and_frames(program, plastic, rougher, tmp_path) -> None:
    paths = [str(tmp_path / name) for name in ("a.json", "b.json")]
    plastic.save(paths[0])
    rougher.save(paths[1])
    rows = [(paths[0], paths[1]), (paths[0], paths[0]), (paths[1], paths[0])]
    columns = {"reference": [a for a, _ in rows], "candidate": [b for _, b in rows]}
    found = vernis.score(rows, ["vernis", "D9.Cl", "vernis-loss"])
    assert list(found)[:3] == ["vernis", "D9.Cl", "vernis-loss"]
    assert {"mos", "mos_low", "mos_high", "mos:vernis-loss"} <= set(found)
    assert found["vernis"].tolist() == [vernis.metric("vernis")(*row) for row in rows]
    (tmp_path / "pairs.csv").write_text("reference,candidate\n" + "".join(f"{a},{b}\n" for a, b in rows))
    program("score", tmp_path / "pairs.csv", "--metric", "vernis", "--out", tmp_path / "scores.csv")
    lines = (tmp_path / "scores.csv").read_text().splitlines()
    header, cells = lines[0].split(","), [line.split(",") for line in lines[1:]]
    for name in ("vernis", "mos", "mos_low", "mos_high"):
        assert [float(row[header.index(name)]) for row in cells] == found[name].tolist()
    others = [columns, [dict(zip(columns, row)) for row in rows]]
    for package in ("pandas", "polars"):
        try:
            others.append(__import__(package).DataFrame(columns))
        except ImportError:
            print(f"{package} is not installed: its frames are not tested")
    for other in others:
        assert vernis.score(other, "vernis")["vernis"].tolist() == found["vernis"].tolist()
    renamed = {"a": columns["reference"], "b": columns["candidate"]}
    assert vernis.score(renamed, "D9.Cl", reference="a", candidate="b")["D9.Cl"].tolist() == found["D9.Cl"].tolist()


def test_a_bad_row_is_named_or_gets_a_reason(plastic, rougher) -> None:
    rows = [(plastic, rougher), (plastic, "nothing.binary")]
    with pytest.raises(FileNotFoundError):
        vernis.score(rows, "D9.Cl")
    found = vernis.score(rows, "D9.Cl", errors="nan")
    assert found["D9.Cl"][0] > 0 and np.isnan(found["D9.Cl"][1])
    assert found["reason"][0] == "" and "nothing.binary" in found["reason"][1]
    for wrong, said in (({"reference": []}, "no column 'candidate'"), (["ab"], "row 0"), ([(plastic,)], "row 0")):
        with pytest.raises(vernis.InputError, match=said):
            vernis.score(wrong, "D9.Cl")
    with pytest.raises(vernis.InputError, match="errors"):
        vernis.score(rows, "D9.Cl", errors="ignore")
    with pytest.raises(vernis.InputError, match="name at least one"):
        vernis.score(rows, [])


def test_metrics_on_stimuli(plastic, rougher) -> None:
    small = "light=lamps,shape=sphere,size=16x24,samples=2"
    found = vernis.compare(plastic, rougher, [f"stimulus[{name},{small}]" for name in ("ssim", "cielab", "flip")])
    assert len(found) == 3 and all(value > 0 for value in found.values())
    ssim = vernis.metric(f"stimulus[ssim,{small}]")
    assert ssim(plastic, plastic) == 0 and not ssim.usable_as_loss
    assert ssim.prepare(plastic).distance(rougher) == found[ssim.name]
    for name, said in [("stimulus[nossim]", "vernis metrics"), ("stimulus[ssim,light=none.hdr]", "none.hdr"), ("stimulus[matsim]", "weights")]:
        with pytest.raises(vernis.InputError, match=said):
            vernis.metric(name)


def test_the_operators_come_from_the_cache(cache, plastic) -> None:
    vernis.metric("vernis")(plastic, plastic)

    def kept() -> dict[str, int]:
        return {str(path): path.stat().st_mtime_ns for path in sorted(cache.rglob("*")) if path.is_file()}

    before = kept()
    assert before
    code = "import vernis; a = vernis.model('lambert', kd=0.2); print(vernis.metric('vernis')(a, a))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    # A second process takes what is there, and writes nothing.
    assert done.stdout == "0.0\n" and kept() == before


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space of a process")
def test_a_machine_without_room_for_the_threads_says_so() -> None:
    code = "import vernis; a = vernis.model('lambert', kd=0.2); print(vernis.metric('D9.Cl')(a, a))"
    limited = ["sh", "-c", 'ulimit -v 3000000; exec "$@"', "sh", sys.executable, "-c", code]
    many = {**os.environ, "RAYON_NUM_THREADS": "4096"}
    done = subprocess.run(limited, capture_output=True, text=True, env=many)
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 1 and last.startswith("vernis.Error: the worker threads") and "RAYON_NUM_THREADS" in last, done.stderr


def test_the_package_teaches() -> None:
    import inspect

    for name in vernis.__all__:
        thing = getattr(vernis, name)
        if not name.startswith("_"):
            assert inspect.getdoc(thing), name
    assert "value_and_grad" in vernis.__doc__
