"""Fits of models to BRDFs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from . import _arrays, _vernis
from ._brdf import Brdf, BrdfLike, as_brdf, figure
from ._errors import InputError
from ._export import Material, translated
from ._metric import Metric, MetricLike, metric as metric_of
from ._progress import ProgressLike, reporter

__all__ = ["Fit", "fit"]


class Fit:
    """The result of `fit`.

    Attributes
    ----------
    brdf : Brdf
        The model with the parameters that were found.
    reference : Brdf
        What was fitted.
    """

    __slots__ = ("_file", "_materials", "_metric", "_text", "brdf", "reference")

    def __init__(self, brdf: Brdf, reference: Brdf, text: str, metric: Metric) -> None:
        self.brdf, self.reference, self._text, self._file = brdf, reference, text, json.loads(text)
        self._metric = metric
        self._materials: dict[str, Material] = {}

    @property
    def model(self) -> str:
        """The identifier of the model."""
        return self._file["model"]

    @property
    def parameters(self) -> dict[str, float | list[float]]:
        """The parameters that were found, by name; colours as three numbers."""
        return dict(self._file["parameters"])

    @property
    def value(self) -> float:
        """The metric's distance at the end, in its unit."""
        return self._file["value"]

    @property
    def value_at_start(self) -> float:
        """The metric's distance at the first start; infinite where it has none there."""
        found = self._file["value_at_start"]
        return float("inf") if found is None else found

    @property
    def stop(self) -> str:
        """Why the search ended, such as ``"converged"`` or ``"evaluation-limit"``."""
        return self._file["stop"]

    @property
    def converged(self) -> bool:
        """Whether the result is a minimum as far as the search can tell."""
        return self.stop not in ("evaluation-limit", "flat", "interrupted")

    @property
    def evaluations(self) -> int:
        """Evaluations of the loss, of all starts and searches."""
        return self._file["evaluations"] + self._file["polish_evaluations"]

    @property
    def history(self) -> list[tuple[int, float]]:
        """Improvements of the search that won: evaluations so far, and the loss of the search."""
        return [(int(n), float(value)) for n, value in self._file["history"]]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the fit as a ``.json`` file, which the program and `open` read as a BRDF."""
        path = Path(path)
        if path.suffix != ".json":
            raise InputError(f"path is {path}; it must end in .json")
        path.write_text(self._text, encoding="utf-8")

    def material(self, renderer: str, progress: ProgressLike = None) -> Material:
        """The material of a renderer in place of the fit, with what the translation costs.

        Parameters
        ----------
        renderer : {"mitsuba", "pbrt", "materialx", "gltf"}
            See `export`.
        progress : bool or callable, optional
            True for a bar of tqdm, or a function (stage, done, total).

        Returns
        -------
        Material
            The exact counterpart of the fitted model, or else the nearest that the renderer has. Its `costs` are told in the metric of
            the fit, in `vernis-loss` and in `vernis`. It is made once.
        """
        if renderer not in self._materials:
            name, version = self._file["metric"]["name"], self._file["metric"]["version"]
            note = f"{self.model} of {self.reference.name} under {name} {version}"
            self._materials[renderer] = translated(self.brdf, renderer, self._metric, note, progress)
        return self._materials[renderer]

    def to_mitsuba(self) -> dict[str, Any]:
        """A dictionary for ``mitsuba.load_dict``; see `material` for what the translation costs."""
        return self.material("mitsuba").dictionary

    def to_pbrt(self) -> str:
        """Named materials for pbrt-v4, the last of which is called ``vernis-material``; see `material` for the cost."""
        return self.material("pbrt").text

    def to_materialx(self) -> str:
        """A document of MaterialX 1.39 with an OpenPBR surface; see `material` for the cost."""
        return self.material("materialx").text

    def to_gltf(self) -> dict[str, Any]:
        """A glTF 2.0 file with one material, as a dictionary for ``json.dump``; see `material` for the cost."""
        return self.material("gltf").dictionary

    def __repr__(self) -> str:
        return f"<vernis.Fit {self.model} of {self.reference.name}: {self.value:.6f}, {self.stop}>"

    def _repr_html_(self) -> str:
        name, version = self._file["metric"]["name"], self._file["metric"]["version"]
        return figure([self.reference, self.brdf]) + f"<div>{name} {version}: {self.value:.4f}, {self.stop}</div>"


def fit(
    reference: BrdfLike,
    model: str,
    metric: MetricLike = "vernis-loss",
    *,
    start: str | Brdf | Mapping[str, Any] | None = None,
    optimizer: str | None = None,
    starts: int = 1,
    seed: int = 1,
    coarsening: int = 3,
    max_evaluations: int | None = None,
    data: Any = None,
    progress: ProgressLike = None,
) -> Fit:
    """Fits a model to a BRDF, with any metric as the loss.

    Parameters
    ----------
    reference : str, Brdf or function
        What is fitted.
    model : str
        A model, or a sum such as ``"ggx+ward"``.
    metric : str, path or Metric
        The loss.
    start : str, Brdf or mapping, optional
        ``"staged"``, ``"log"`` (fits under D9.Cl, then moves gradually to a learned metric), ``"log-at-once"``, or a BRDF of the model
        or its parameters. By default ``"log"`` for learned metrics whose landscape has hollows, such as ``vernis``, else
        ``"staged"``.
    optimizer : {"hooke-jeeves", "nelder-mead", "lbfgs"}, optional
        By default ``"lbfgs"`` for learned metrics where the model has a gradient, else ``"hooke-jeeves"``.
    starts : int
        Number of starts to search from, 1 to 1000; the best result counts.
    seed : int
        Of the random starts.
    coarsening : int
        Cells of the metric to one cell of the search, along each axis, for Lp.
    max_evaluations : int, optional
        For each start; by default 5000 for Lp metrics and 400 for others.
    data : path, optional
        Folder that relative notations are looked up in.
    progress : bool or callable, optional
        True for a bar of tqdm, or a function (stage, done, total).

    Returns
    -------
    Fit
        The best that was found. A search that spends its evaluations is no error: see `Fit.converged`.

    Raises
    ------
    UnknownNameError
        There is no such model or metric.
    InputError
        A setting that cannot be; a metric without a gradient under ``"lbfgs"``; a reference that cannot be compared.
    """
    brdf = as_brdf(reference, "reference", data)
    parameters = None
    if isinstance(start, Mapping):
        from ._brdf import model as model_of

        start = model_of(model, **start)
    if isinstance(start, Brdf):
        if start.model != model:
            raise InputError(f"start is a {start.model or 'BRDF that is no model'}; it must be a {model}")
        parameters = [float(x) for _, values in start._handle.parameters or () for x in values]
        start = None
    options = {
        "start": start,
        "parameters": parameters,
        "method": optimizer,
        "starts": _whole(starts, "starts", 1, 1000),
        "seed": _whole(seed, "seed", 0, 2**64 - 1),
        "coarsening": _whole(coarsening, "coarsening", 1, 15),
        "max_evaluations": None if max_evaluations is None else _whole(max_evaluations, "max_evaluations", 10, 10**8),
    }
    loss = metric_of(metric)
    with reporter(progress) as report:
        handle, text = _vernis.fit(brdf._handle, brdf.name, model, loss._handle, options, report)
    return Fit(Brdf._of(handle, model), brdf, text, loss)


def _whole(number: Any, what: str, low: int, high: int) -> int:
    array = _arrays.real(number, what)
    if array.ndim or array.dtype.kind == "f" or not low <= int(array) <= high:
        raise InputError(f"{what} is {number!r}; it must be a whole number from {low} to {high}")
    return int(array)
