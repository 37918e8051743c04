"""Studies: training and benchmarks as the program does them."""

from __future__ import annotations

import json

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
    ],
)
def test_wrong_settings_are_refused(wrong, error) -> None:
    with pytest.raises(error):
        vernis.benchmark(**wrong)


def test_the_program_comes_with_the_wheel(program) -> None:
    assert program("--version").startswith("vernis ")
    assert "did you mean" in program("compare", "a.json", "b.json", "--metric", "vernsi", code=2)
