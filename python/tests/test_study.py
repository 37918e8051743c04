"""Studies: training and benchmarks as the program does them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import vernis


def test_training_is_that_of_the_program(program, plastic, rougher, tmp_path) -> None:
    stages = set()
    trained = vernis.train(
        "synthetic", tmp_path / "mine", resamples=40, progress=lambda stage, done, total: stages.add(stage)
    )
    program("train", "--study", "synthetic", "--resamples", 40, "--out", tmp_path / "program")
    for path in (trained.path, trained.loss_path):
        mine, theirs = (json.loads(p.read_text()) for p in (path, tmp_path / "program" / path.name))
        for key in mine:
            if key != "provenance":
                assert mine[key] == theirs[key], key
    assert trained.metric.synthetic and "SYNTHETIC" in trained.metric.quote() and "SYNTHETIC" in str(trained.agreement)
    assert trained.metric(plastic, plastic) == 0.0 and trained.loss(plastic, rougher) > 0
    assert trained.loss.differentiable and stages
    # The same files, whatever their order; pages name the command.
    names = sorted(path.name for path in (tmp_path / "program").iterdir())
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == names and trained.report_path.name in names
    for name in (name for name in names if name.endswith(".csv")):
        assert (tmp_path / "mine" / name).read_bytes() == (tmp_path / "program" / name).read_bytes(), name
    record = json.loads((tmp_path / "program" / "benchmark.json").read_text())
    assert trained.agreement.record["headline"] == record["headline"]
    # A file never hides another metric, nor stands under its name.
    copy = tmp_path / "copy.vernis.json"
    copy.write_text(json.dumps({**json.loads(trained.path.read_text()), "name": "vernis"}))
    found = vernis.compare(plastic, rougher, ["vernis", copy])
    assert list(found) == ["vernis", "vernis@copy.vernis.json"] and len(set(found.values())) == 2
    (tmp_path / "other").mkdir()
    twin = tmp_path / "other" / "copy.vernis.json"
    twin.write_text(copy.read_text())
    with pytest.raises(vernis.InputError, match="ask for only one"):
        vernis.compare(plastic, rougher, [copy, twin])


def small_study(folder) -> Path:
    """Five materials with five candidates each, graded by a rule: enough to train on."""
    lines = ["reference,candidate,mos,material"]
    for number in range(5):
        kd, alpha = 0.1 + 0.05 * number, 0.08 + 0.04 * number
        for step, factor in enumerate((1.0, 1.2, 1.5, 2.0, 2.6)):
            vernis.model("ggx", kd=kd / factor, f0=0.04, alpha=min(1.0, alpha * factor)).save(folder / f"m{number}-{step}.json")
            lines.append(f"m{number}-0.json,m{number}-{step}.json,{4.5 - 0.8 * step - 0.05 * number},m{number}")
    path = folder / "ratings.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_what_is_measured_stays_when_what_follows_is_interrupted(tmp_path) -> None:
    study, out = small_study(tmp_path), tmp_path / "out"

    def stop(stage: str, done: int, total: int) -> None:
        if (out / "benchmark.json").exists():
            raise LookupError(stage)

    with pytest.raises(LookupError):
        vernis.train(study, out, folds=4, resamples=40, progress=stop)
    record = json.loads((out / "benchmark.json").read_text())
    assert record["metrics"] and {path.suffix for path in out.iterdir()} == {".json", ".csv"}
    assert not list(out.glob("*.vernis.json"))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"name": "../mine"}, "begin with a letter or digit"),
        ({"name": ""}, "begin with a letter or digit"),
        ({"name": 3}, "name is 3"),
        ({"name": "vernis"}, "is a metric of vernis itself"),
        ({"name": "ot"}, "is a metric of vernis itself"),
        ({"out": "file/out"}, "file/out"),
    ],
)
def test_training_that_could_not_be_written_is_refused_before_the_work(wrong, said: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")

    def told(*news: object) -> None:
        raise AssertionError("work began")

    with pytest.raises(vernis.InputError, match=said):
        vernis.train(**{"study": "synthetic", "out": tmp_path / "out", "progress": told, **wrong})


def test_the_study_is_never_replaced_by_results(tmp_path) -> None:
    study = small_study(tmp_path).rename(tmp_path / "metrics.csv")
    with pytest.raises(vernis.InputError, match="would replace the study"):
        vernis.train(study, tmp_path)
    assert study.read_text().startswith("reference,")


def test_the_embedded_study_in_place_of_the_open_one_is_no_secret(tmp_path) -> None:
    def enough(stage: str, done: int, total: int) -> None:
        raise LookupError(stage)

    (tmp_path / "empty").mkdir()
    with pytest.warns(UserWarning, match="SYNTHETIC"), pytest.raises(LookupError):
        vernis.benchmark(data=tmp_path / "empty", progress=enough)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"study": "nothing.csv"}, FileNotFoundError),
        ({"study": "synthetc"}, vernis.UnknownNameError),
        ({"study": "synthetic", "folds": 1}, vernis.InputError),
        ({"study": "synthetic", "resamples": 3}, vernis.InputError),
        ({"study": "synthetic", "seed": "one"}, vernis.InputError),
        ({"study": "synthetic", "metrics": "stimulus[ssim]"}, vernis.InputError),
        ({"study": "synthetic", "metrics": ["stimulus[sim]"]}, vernis.InputError),
        ({"study": "synthetic", "metrics": ["vernis"]}, vernis.InputError),
    ],
)
def test_wrong_settings_are_refused(wrong, error) -> None:
    with pytest.raises(error):
        vernis.benchmark(**wrong)


def test_the_program_comes_with_the_wheel(program) -> None:
    assert program("--version").startswith("vernis ")
    assert "did you mean" in program("compare", "a.json", "b.json", "--metric", "vernsi", code=2)
