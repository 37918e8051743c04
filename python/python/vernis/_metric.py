"""Metrics: distances between BRDFs, and their gradients. Many metrics and many pairs are in `_score`."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np

from . import _arrays, _vernis
from ._brdf import Brdf, BrdfLike, as_brdf, figure
from ._errors import InputError
from ._progress import ProgressLike, reporter

__all__ = ["Metric", "Nodes", "Prepared", "Score", "metric", "metrics"]


@dataclass(frozen=True)
class Score:
    """What a metric says of a pair.

    Attributes
    ----------
    distance : float
        0 for identical BRDFs, larger is worse, in the unit of the metric.
    mos : float or None
        The mean opinion score that a metric learned from ratings predicts, 1 (very poor) to 5 (excellent) unless `scale` says otherwise.
    low, high : float or None
        Ends of its 95 % interval.
    scale : tuple of float or None
        Worst and best end of the scale of `mos`.
    channels : tuple of float or None
        The distances of red, green and blue alone, for metrics that have them.
    """

    distance: float
    mos: float | None = None
    low: float | None = None
    high: float | None = None
    scale: tuple[float, float] | None = None
    channels: tuple[float, float, float] | None = None
    _pair: tuple[Brdf, Brdf] | None = field(default=None, compare=False)

    def __float__(self) -> float:
        return self.distance

    def __repr__(self) -> str:
        if self.mos is None:
            return f"Score(distance={self.distance!r})"
        return f"Score(distance={self.distance!r}, mos={self.mos!r}, low={self.low!r}, high={self.high!r})"

    def _repr_html_(self) -> str:
        said = f"distance {self.distance:.4f}"
        if self.mos is not None and self.scale is not None:
            said += f", predicted MOS {self.mos:.2f} of {self.scale[1]:g}, 95 % between {self.low:.2f} and {self.high:.2f}"
        return (figure(list(self._pair)) if self._pair else "") + f"<div>{said}</div>"

    @classmethod
    def _of(cls, parts: Any, pair: tuple[Brdf, Brdf] | None = None) -> Score:
        distance, score, channels = parts
        channels = None if channels is None else tuple(channels)
        if score is None:
            return cls(distance, channels=channels, _pair=pair)
        mos, low, high, worst, best = score
        return cls(distance, mos, low, high, (worst, best), channels, pair)


@dataclass(frozen=True, eq=False)
class Nodes:
    """The directions at which a metric looks at a BRDF.

    Attributes
    ----------
    wi, wo : ndarray of float64, shape (n, 3)
        Unit vectors towards the light and towards the viewer, +z being the normal. Read only.
    id : str
        Name of the layout. Values for one id fit every metric with nodes of that id.
    """

    wi: _arrays.Floats
    wo: _arrays.Floats
    id: str

    def __len__(self) -> int:
        return len(self.wi)


class Prepared:
    """A metric with its reference: what a fit or an optimiser asks again and again. Made by `Metric.prepare`."""

    __slots__ = ("_handle", "_nodes", "metric", "reference")

    def __init__(self, metric: Metric, reference: Brdf) -> None:
        self.metric = metric
        self.reference = reference
        self._handle = metric._handle.prepare(reference._handle)
        self._nodes: Nodes | None = None

    @property
    def nodes(self) -> Nodes:
        """The directions at which the metric looks, in the order of the values that it takes.

        Raises
        ------
        InputError
            The metric cannot work on values.
        """
        if self._nodes is None:
            name, wi, wo = self._handle.node_directions()
            for array in (wi, wo):
                array.flags.writeable = False
            self._nodes = Nodes(wi, wo, name)
        return self._nodes

    def evaluate(self, brdf: BrdfLike) -> _arrays.Floats:
        """The values of a BRDF on the nodes, as the metric reads it: shape (n, 3), NaN for missing measurements."""
        return self._handle.evaluate(as_brdf(brdf, "brdf")._handle)

    def distance(self, candidate: BrdfLike) -> float:
        """The distance to a candidate.

        Parameters
        ----------
        candidate : Brdf, str, function, or array_like of shape (n, 3)
            A BRDF, or its values on `nodes`: linear RGB, 1/sr, cosine not included.

        Raises
        ------
        InputError
            A candidate that cannot be compared; values that are negative or not finite, or too many or too few.
        """
        if _is_values(candidate):
            return self._handle.distance_at(self._one(candidate))
        return self.score(candidate).distance

    def score(self, candidate: BrdfLike) -> Score:
        """All that the metric says of a candidate."""
        candidate = as_brdf(candidate, "candidate")
        return Score._of(self._handle.measure(candidate._handle), (self.reference, candidate))

    def distances(self, values: Any, progress: ProgressLike = None) -> _arrays.Floats:
        """The distances to a batch of candidates, on all cores.

        Parameters
        ----------
        values : array_like, shape (batch, n, 3)
            Values on `nodes`.
        progress : bool or callable, optional
            True for a bar of tqdm, or a function (stage, done, total).

        Returns
        -------
        ndarray of float64, shape (batch,)
        """
        batch = _arrays.values(values, self._node_count())
        if batch.ndim != 3:
            raise InputError(f"values has the shape {batch.shape}; a batch has three axes, (batch, {batch.shape[0]}, 3)")
        with reporter(progress) as report:
            return np.array(self._handle.distances_at(batch, report), dtype=np.float64)

    def value_and_grad(self, values: Any, as_loss: bool = False) -> tuple[float, _arrays.Floats]:
        """The distance to a candidate, and its derivatives by the candidate's values.

        Parameters
        ----------
        values : array_like, shape (n, 3)
            Values on `nodes`: linear RGB, 1/sr, cosine not included, finite and not negative.
        as_loss : bool
            What a fit minimises in place of the distance. For metrics learned from ratings it is smoother, and it goes below zero
            where a candidate is predicted to be rated better than the reference itself; for others it is the distance.

        Returns
        -------
        value : float
            In the unit of the metric.
        gradient : ndarray of float64, shape (n, 3)
            Always finite, also where the distance is zero.

        Raises
        ------
        InputError
            The metric has no gradient; wrong values.
        """
        return self._handle.value_and_grad(self._one(values), as_loss)

    def _node_count(self) -> int:
        return self._handle.node_count()[1]

    def _one(self, values: Any) -> _arrays.Floats:
        array = _arrays.values(values, self._node_count())
        if array.ndim != 2:
            raise InputError(f"values has the shape {array.shape}; it must be that of one candidate, {array.shape[1:]}")
        return array

    def __reduce__(self) -> tuple[Any, ...]:
        return Prepared, (self.metric, self.reference)

    def __repr__(self) -> str:
        return f"<vernis.Prepared {self.metric.name} against {self.reference.name}>"


def _is_values(candidate: Any) -> bool:
    return isinstance(candidate, (np.ndarray, list, tuple))


class Metric:
    """A distance from a reference to a candidate: exactly zero for identical BRDFs, larger is worse, never NaN. Made by `metric`.

    Calling it gives the distance.
    """

    __slots__ = ("_handle", "_properties", "_source")

    def __init__(self, name: str) -> None:
        self._source = name
        self._handle, said = _vernis.Metric.named(name, _vernis.cache_folder())
        self._properties = self._handle.properties
        for line in said:
            warnings.warn(line, stacklevel=3)

    @property
    def name(self) -> str:
        """The name in lists and results."""
        return self._properties["name"]

    @property
    def version(self) -> str:
        """The version of its numbers. Quote it with any of them."""
        return self._properties["version"]

    @property
    def unit(self) -> str:
        """The unit of the distance, ``"1"`` where it has none."""
        return self._properties["unit"]

    @property
    def lower_is_better(self) -> bool:
        """True: every metric here is a distance."""
        return True

    @property
    def symmetric(self) -> bool:
        """Whether reference and candidate may be exchanged."""
        return self._properties["symmetric"]

    @property
    def differentiable(self) -> bool:
        """Whether `Prepared.value_and_grad` works."""
        return self._properties["differentiable"]

    @property
    def usable_as_loss(self) -> bool:
        """Whether it can drive a fit."""
        return self._properties["usable_as_loss"]

    @property
    def synthetic(self) -> bool:
        """Whether it was learned from simulated observers: its numbers then say nothing about people."""
        return self._properties["synthetic"]

    @property
    def summary(self) -> str:
        """One line on what it is."""
        return self._properties["summary"]

    @property
    def source(self) -> str:
        """Paper, equation, DOI."""
        return self._properties["source"]

    def quote(self) -> str:
        """What to write beside a number of this metric, so that it can be made again."""
        synthetic = ", trained on SYNTHETIC observers" if self.synthetic else ""
        return f"{self.name} {self.version}{synthetic}; {self.source}; computed by vernis {_vernis.__version__}"

    def __call__(self, reference: BrdfLike, candidate: BrdfLike) -> float:
        """The distance. Any of the two is a notation, a Brdf, or a function (wi, wo) -> values."""
        reference, candidate = as_brdf(reference, "reference"), as_brdf(candidate, "candidate")
        return self._handle.distance(reference._handle, candidate._handle)

    def score(self, reference: BrdfLike, candidate: BrdfLike) -> Score:
        """All that the metric says of a pair: for learned metrics also the predicted mean opinion score and its interval."""
        pair = as_brdf(reference, "reference"), as_brdf(candidate, "candidate")
        return Score._of(self._handle.measure(pair[0]._handle, pair[1]._handle), pair)

    def prepare(self, reference: BrdfLike) -> Prepared:
        """Pays for the reference once. The result owns all it needs, and pickles where the reference was opened or is a model."""
        return Prepared(self, as_brdf(reference, "reference"))

    def __reduce__(self) -> tuple[Any, ...]:
        return metric, (self._source,)

    def __repr__(self) -> str:
        return f"<vernis.Metric {self.name} {self.version}: {self.summary}>"


#: What stands for a metric wherever one is asked for.
MetricLike = Union[str, "os.PathLike[str]", Metric]


def metric(name: MetricLike) -> Metric:
    """A metric by name, or from the file of an exported one.

    Parameters
    ----------
    name : str or path
        One of `metrics`, a member of a family such as ``"energy[alpha=0.05]"``, or the path of a ``.vernis.json`` file.

    Raises
    ------
    UnknownNameError
        There is no such metric; ``nearest`` has those that are similar.
    """
    if isinstance(name, Metric):
        return name
    if not isinstance(name, (str, os.PathLike)):
        raise InputError(f"metric is a {type(name).__name__}; it must be a name, a path, or a Metric")
    return Metric(os.fspath(name))


def differentiable(name: MetricLike, reference: BrdfLike) -> Prepared:
    """A metric that has a gradient, with its reference."""
    chosen = metric(name)
    if not chosen.differentiable:
        raise InputError(f"{chosen.name} has no gradient; vernis.metrics() says which have one")
    return chosen.prepare(reference)


def metrics() -> dict[str, dict[str, Any]]:
    """All metrics that have a name of their own, each with version, family, unit, summary, source, and what it can do."""
    return {properties["name"]: dict(properties) for properties in _vernis.metrics()}
