"""Studies: metrics trained on ratings, and benchmarks of metrics."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from . import _vernis
from ._brdf import data_folder
from ._errors import InputError
from ._fit import _whole
from ._metric import Metric, metric
from ._progress import ProgressLike, reporter

__all__ = ["Benchmark", "Trained", "benchmark", "train"]


class Benchmark:
    """How well metrics agree with the ratings of a study, measured on materials and methods that they were not trained on.

    Attributes
    ----------
    record : dict
        All that was measured, as in the program's ``benchmark.json``.
    """

    __slots__ = ("_summary", "record")

    def __init__(self, record: str, summary: str, said: list[str]) -> None:
        self.record: dict[str, Any] = json.loads(record)
        self._summary = summary
        for line in said:
            warnings.warn(line, stacklevel=3)

    @property
    def synthetic(self) -> bool:
        """Whether the ratings came from simulated observers: the agreement then says nothing about people."""
        return bool(self.record["synthetic"])

    def __str__(self) -> str:
        label = "SYNTHETIC: these ratings come from simulated observers and say nothing about people.\n" if self.synthetic else ""
        return self._summary + label

    def __repr__(self) -> str:
        return f"<vernis.Benchmark of {self.record['study']}>"


class Trained:
    """The result of `train`.

    Attributes
    ----------
    metric : Metric
        The metric, trained on all rows.
    loss : Metric
        The distance that it begins with: the one to fit with.
    agreement : Benchmark
        How well the recipe agrees with people, on held-out rows.
    path, loss_path : Path
        The files of the two.
    report_path : Path
        A page with tables and figures on the agreement: ``report.html``.
    """

    __slots__ = ("agreement", "loss", "loss_path", "metric", "path", "report_path")

    def __init__(self, path: Path, loss_path: Path, report_path: Path, agreement: Benchmark) -> None:
        self.path, self.loss_path, self.report_path, self.agreement = path, loss_path, report_path, agreement
        self.metric: Metric = metric(path)
        self.loss: Metric = metric(loss_path)

    def __repr__(self) -> str:
        return f"<vernis.Trained {self.metric.name} on {self.agreement.record['study']}: {self.path}>"


def train(
    study: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] = "out",
    *,
    name: str | None = None,
    folds: int | None = None,
    resamples: int = 2000,
    seed: int = 1,
    variants: bool = False,
    metrics: Iterable[str] = (),
    data: Any = None,
    progress: ProgressLike = None,
) -> Trained:
    """Trains a metric on a study, and measures it under nested cross-validation.

    Parameters
    ----------
    study : str or path, optional
        ``"lavoue2021-open"``, ``"synthetic"``, or a CSV file of one's own ratings; by default the open study where the data folder has
        it, else the embedded synthetic one, with a warning.
    out : path
        Folder for the files that ``vernis train`` writes: ``benchmark.json`` and tables as CSV, which are written as soon as the
        metrics are measured and again after each stage that follows, then the two metrics, then ``report.html`` with its figures. It
        is made where it is missing. Files of these names are replaced. What is written stays if a later stage fails or is
        interrupted.
    name : str, optional
        Of the exported metric: letters, digits, ``-``, ``_`` and ``.``, and no name of `metrics`. By default ``vernis-STUDY``, and
        ``vernis`` for the open study.
    folds : int, optional
        Cross-validation folds, by material.
    resamples : int
        Bootstrap resamples of materials, 40 to 20000.
    seed : int
        The same seed gives the same bytes.
    variants : bool
        Also judge the metric with one part changed.
    metrics : several str
        Names of further metrics that are judged as well: members of the families of distances, or ``"stimulus[ssim]"`` and the like on
        rendered pictures; ``"all-stimulus"`` stands for all of these. None that was learned from ratings.
    data : path, optional
        The data folder; by default that of the variable ``VERNIS_DATA``.
    progress : bool or callable, optional
        True for a bar of tqdm, or a function (stage, done, total).

    Returns
    -------
    Trained
    """
    options = _options(study, _free(name), folds, resamples, seed, variants, metrics, data)
    with reporter(progress) as report:
        found = _vernis.train(options, os.fspath(out), report)
    return Trained(Path(found.metric), Path(found.loss), Path(found.report), Benchmark(*found.measured))


def benchmark(
    study: str | os.PathLike[str] | None = None,
    *,
    folds: int | None = None,
    resamples: int = 2000,
    seed: int = 1,
    variants: bool = False,
    metrics: Iterable[str] = (),
    data: Any = None,
    progress: ProgressLike = None,
) -> Benchmark:
    """Measures all metrics on a study under nested cross-validation, without exporting one. Parameters as for `train`."""
    with reporter(progress) as report:
        return Benchmark(*_vernis.benchmark(_options(study, None, folds, resamples, seed, variants, metrics, data), report))


def _free(name: str | None) -> str | None:
    """The name of a metric and of a file, which is that of no other metric."""
    if name is None:
        return None
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", name):
        raise InputError(
            f"name is {name!r}; it must begin with a letter or digit and have at most 100 letters, digits, '-', '_' and '.'"
        )
    for taken in (name, f"{name}-loss"):
        try:
            _vernis.resolve(taken)
        except InputError:
            continue
        raise InputError(f"name is {name!r}; {taken} is a metric of vernis itself: choose another name")
    return name


def _names(metrics: Iterable[str]) -> list[str]:
    """Those names, checked; a single one is no list."""
    names = [] if isinstance(metrics, (str, bytes)) else list(metrics)
    if isinstance(metrics, (str, bytes)) or not all(isinstance(name, str) for name in names):
        raise InputError(f"metrics is {metrics!r}; it must be a list of names, such as ['stimulus[ssim]']")
    return names


def _options(
    study: Any, name: str | None, folds: int | None, resamples: int, seed: int, variants: bool, metrics: Iterable[str], data: Any
) -> dict[str, Any]:
    folder = data_folder(data)
    if study is None:
        study, missing = _vernis.default_study(folder)
        if missing is not None:
            warnings.warn(
                f"study {study}: SYNTHETIC observers, generated by code; for human ratings name a data folder ({missing})",
                stacklevel=3,
            )
    return {
        "study": os.fspath(study),
        "data": folder,
        "cache": _vernis.cache_folder(),
        "name": name,
        "folds": None if folds is None else _whole(folds, "folds", 2, 10**6),
        "resamples": _whole(resamples, "resamples", 40, 20000),
        "seed": _whole(seed, "seed", 0, 2**64 - 1),
        "variants": bool(variants),
        "metrics": _names(metrics),
    }
