"""Fits: the program's result, starts, progress, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import vernis


def test_a_fit_is_that_of_the_program(program, plastic, tmp_path) -> None:
    plastic.save(tmp_path / "plastic.json")
    fit = vernis.fit(tmp_path / "plastic.json", "ward-duer", max_evaluations=60)
    program("fit", tmp_path / "plastic.json", "--model", "ward-duer", "--max-evaluations", 60, "--out", tmp_path / "w.json", code=fit_code(fit))
    expected = json.loads((tmp_path / "w.json").read_text())
    assert fit.parameters == expected["parameters"] and fit.value == expected["value"]
    assert fit.history == [tuple(h) for h in expected["history"]] and fit.stop == expected["stop"]
    fit.save(tmp_path / "mine.json")
    assert vernis.open(tmp_path / "mine.json").parameters == fit.parameters == fit.brdf.parameters
    assert vernis.metric("vernis-loss")(plastic, fit.brdf) == fit.value
    assert fit._repr_html_().count("<img") == 2 and "ward-duer" in repr(fit)


def fit_code(fit: vernis.Fit) -> int:
    return 0 if fit.converged else 3


def test_a_fit_of_a_function_from_given_parameters_finds_the_material(plastic) -> None:
    start = {"kd": 0.1, "f0": 0.1, "alpha": 0.3}
    told = []
    fit = vernis.fit(lambda wi, wo: plastic(wi, wo), "ggx", "D4.Cl.CR", start=start, progress=lambda *news: told.append(news))
    assert fit.parameters["alpha"] == pytest.approx(0.15, rel=0.01)
    assert fit.parameters["kd"] == pytest.approx([0.2, 0.1, 0.05], rel=0.01)
    assert fit.value < fit.value_at_start
    assert all(isinstance(stage, str) and done >= 1 for stage, done, _ in told)


@pytest.mark.parametrize(
    ("wrong", "error", "said"),
    [
        ({"model": "ggxx"}, vernis.UnknownNameError, "did you mean ggx"),
        ({"metric": "D44"}, vernis.UnknownNameError, "D4"),
        ({"metric": "D6"}, vernis.InputError, "jumps"),
        ({"optimizer": "newton"}, vernis.InputError, "newton"),
        ({"start": "anywhere"}, vernis.InputError, "staged, log"),
        ({"start": vernis.model("lambert", kd=0.1)}, vernis.InputError, "it must be a ggx"),
        ({"starts": 0}, vernis.InputError, "from 1 to 1000"),
        ({"seed": -1}, vernis.InputError, "seed is -1"),
        ({"max_evaluations": 1.5}, vernis.InputError, "whole number"),
        ({"coarsening": 16}, vernis.InputError, "from 1 to 15"),
        ({"progress": 3}, vernis.InputError, "progress is 3"),
    ],
)
def test_wrong_settings_are_refused(wrong, error, said: str, plastic) -> None:
    with pytest.raises(error, match=said):
        vernis.fit(**{"reference": plastic, "model": "ggx", "metric": "D4.Cl.CR", **wrong})


def test_an_exception_of_the_callback_ends_a_fit(plastic) -> None:
    def stop(stage: str, done: int, total: int) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        vernis.fit(plastic, "sgd", "energy", max_evaluations=100000, progress=stop)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "work",
    [
        "vernis.fit(a, 'sgd', 'energy', max_evaluations=100000)",
        "vernis.train('synthetic', out=out)",
        "[p.distances(v) for _ in range(10**6)]",
    ],
)
def test_ctrl_c_ends_long_work(work: str, tmp_path) -> None:
    code = (
        "import signal, sys, numpy as np, vernis\n"
        # A process that was started in the background ignores the signal.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "a = vernis.model('ggx', kd=0.2, f0=0.04, alpha=0.2); out = sys.argv[1]\n"
        "p = vernis.metric('vernis').prepare(a); v = np.stack([p.evaluate(a)] * 64)\n"
        "print('ready', flush=True)\n"
        f"{work}\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(3)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert "KeyboardInterrupt" in said and process.returncode != 0
