"""Materials of renderers in place of a model."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _vernis
from ._brdf import Brdf, BrdfLike, as_brdf, figure
from ._errors import InputError
from ._metric import MetricLike, metric as metric_of
from ._progress import ProgressLike, reporter

__all__ = ["Cost", "Material", "export"]


@dataclass(frozen=True)
class Cost:
    """What a translation costs under one metric: how different the material looks from the model.

    Attributes
    ----------
    metric, version : str
        Name and version of the metric.
    distance : float
        In the metric's unit; 0 is identical.
    mos, low, high : float or None
        The mean opinion score that a learned metric predicts for the pair, and its 95 % interval.
    """

    metric: str
    version: str
    distance: float
    mos: float | None = None
    low: float | None = None
    high: float | None = None


class Material:
    """A material of a renderer in place of a model, made by `export`, `Fit.material` or the ``to_`` methods.

    Attributes
    ----------
    renderer : str
        ``"mitsuba"``, ``"pbrt"``, ``"materialx"`` or ``"gltf"``.
    source : Brdf
        The model that it stands for.
    brdf : Brdf
        The material as the renderer evaluates it: a model with the renderer's parameters.
    exact : bool
        Whether the renderer has the very formula; if not, it is the nearest that it has.
    costs : dict of str to Cost
        What the translation costs, by metric.
    """

    __slots__ = ("_handle", "_note", "brdf", "costs", "exact", "renderer", "source")

    def __init__(self, handle: _vernis.Translation, renderer: str, source: Brdf, note: str) -> None:
        self._handle, self._note, self.renderer, self.source = handle, note, renderer, source
        model = handle.brdf.model_name or ""
        self.brdf = Brdf._of(handle.brdf, f"{model} for {renderer}")
        self.exact = handle.exact
        self.costs = {name: Cost(name, version, distance, *(score or ())) for name, version, distance, score in handle.costs}

    @property
    def model(self) -> str:
        """The identifier of the model that the renderer evaluates, such as ``"principled"``."""
        return self.brdf.model or ""

    @property
    def parameters(self) -> dict[str, float | list[float]]:
        """Its parameters by name; colours as three numbers."""
        return self.brdf.parameters or {}

    @property
    def text(self) -> str:
        """The content of a file for the renderer, with what the translation costs as a comment."""
        return self._handle.text(self._note)

    @property
    def dictionary(self) -> dict[str, Any]:
        """For Mitsuba what ``mitsuba.load_dict`` takes, for glTF the file as a dictionary."""
        if self.renderer == "gltf":
            return json.loads(self.text)
        found = self._handle.dictionary()
        if found is None:
            raise InputError(f"a material of {self.renderer} has no dictionary; its file is `text`")
        return json.loads(found)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the file for the renderer, which ends in ``.xml``, ``.pbrt``, ``.mtlx`` or ``.gltf``."""
        path = Path(path)
        if path.suffix != self._handle.extension:
            raise InputError(f"path is {path}; a material of {self.renderer} must end in {self._handle.extension}")
        path.write_text(self.text, encoding="utf-8")

    def __repr__(self) -> str:
        kind = "exact" if self.exact else "nearest"
        return f"<vernis.Material {self.model} for {self.renderer}, {kind}: {self._handle.costs_in_words}>"

    def _repr_html_(self) -> str:
        return figure([self.source, self.brdf]) + f"<div>{'exact' if self.exact else 'nearest'}: {self._handle.costs_in_words}</div>"


def export(model: BrdfLike, renderer: str, metric: MetricLike = "vernis-loss", *, data: Any = None, progress: ProgressLike = None) -> Material:
    """The material of a renderer that looks like a model.

    Where the renderer has the model, it is the exact counterpart; where it has not, the renderer's most flexible model is fitted to it.

    Parameters
    ----------
    model : str or Brdf
        A model with its parameters, or a fit; a measurement must be fitted first.
    renderer : {"mitsuba", "pbrt", "materialx", "gltf"}
        ``mitsuba``: Mitsuba 3; ``pbrt``: pbrt-v4; ``materialx``: an OpenPBR surface in MaterialX 1.39; ``gltf``: glTF 2.0.
    metric : str, path or Metric
        In which the cost is told, beside `vernis-loss` and `vernis`, which predicts the opinion score. If it was learned, the nearest
        material is nearest in it, else in `vernis-loss`.
    data : path, optional
        Folder that relative notations are looked up in.
    progress : bool or callable, optional
        True for a bar of tqdm, or a function (stage, done, total).

    Raises
    ------
    UnknownNameError
        There is no such renderer or metric.
    InputError
        What is given is no model.

    Examples
    --------
    >>> import vernis
    >>> gold = vernis.model("ggx-conductor", kd=0, eta=[0.16, 0.42, 1.45], k=[3.9, 2.4, 1.8], alpha=0.1)
    >>> vernis.export(gold, "mitsuba").exact
    True
    """
    brdf = as_brdf(model, "model", data)
    return translated(brdf, renderer, metric, f"{brdf.model or 'a BRDF'} of vernis {_vernis.__version__}", progress)


def translated(brdf: Brdf, renderer: str, metric: MetricLike, note: str, progress: ProgressLike) -> Material:
    """The material of `brdf`; `note` is a comment of its file."""
    if not isinstance(renderer, str):
        raise InputError(f"renderer is a {type(renderer).__name__}; it must be a name, such as 'mitsuba'")
    if brdf.model is None:
        raise InputError(f"{brdf.name} is no model; only models can be translated to a renderer: fit one first")
    # Asking for them takes what they need from the cache.
    chosen, _, _ = metric_of(metric), metric_of("vernis-loss"), metric_of("vernis")
    with reporter(progress) as report:
        handle = _vernis.translate(brdf._handle, renderer, chosen._handle, report)
    return Material(handle, renderer, brdf, note)
