"""Distances between BRDFs as differentiable operations of Dr.Jit.

Importing this module imports drjit. The metric itself runs on the CPU: values are brought there and derivatives taken back.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from ._brdf import BrdfLike
from ._errors import InputError
from ._metric import MetricLike, Nodes, differentiable

__all__ = ["Distance"]


def _rows(values: Any) -> np.ndarray:
    """A Dr.Jit array of three channels as rows."""
    return np.ascontiguousarray(np.stack([np.asarray(channel) for channel in values], axis=-1), dtype=np.float64)


class _At(dr.CustomOp):
    def eval(self, values: Any, distance: Any) -> Any:
        self.type = type(values)
        value, self.gradient = distance.prepared.value_and_grad(_rows(values), as_loss=distance.as_loss)
        return type(values[0])(value)

    def _channels(self) -> Any:
        channel = dr.value_t(self.type)
        return self.type(*(channel(np.ascontiguousarray(self.gradient[:, c])) for c in range(3)))

    def forward(self) -> None:
        slope = dr.dot(self._channels(), self.grad_in("values"))
        self.set_grad_out(dr.sum(slope))

    def backward(self) -> None:
        self.set_grad_in("values", self._channels() * self.grad_out())

    def name(self) -> str:
        return "vernis distance"


class Distance:
    """The distance to a reference as a differentiable function of a candidate's values.

    Parameters
    ----------
    metric : str, path or Metric
        A metric with a gradient.
    reference : str, Brdf or function
    as_loss : bool
        What a fit minimises in place of the distance, see `Prepared.value_and_grad`.

    Notes
    -----
    ``distance(values)`` takes an array of three channels of a Dr.Jit variant with automatic differentiation, such as
    ``mitsuba.Color3f``, one entry a node, linear RGB, 1/sr, cosine not included. ``distance(bsdf)`` evaluates a Mitsuba BSDF at
    the nodes, see `vernis.mitsuba.values`, and so leads gradients to its parameters.
    """

    def __init__(self, metric: MetricLike, reference: BrdfLike, as_loss: bool = False) -> None:
        self.prepared = differentiable(metric, reference)
        self.as_loss = as_loss

    @property
    def nodes(self) -> Nodes:
        """The directions at which to evaluate the candidate, as NumPy arrays."""
        return self.prepared.nodes

    def __call__(self, values: Any) -> Any:
        """The distance, an array of one entry of the type of the channels."""
        # Every BSDF of Mitsuba has it, whatever the variant, and no array has.
        if hasattr(values, "eval_pdf_sample"):
            from . import mitsuba as bridge

            values = bridge.values(values, self.nodes.wi, self.nodes.wo)
        if not dr.is_array_v(values) or dr.depth_v(values) != 2 or len(values) != 3:
            raise InputError(f"values is a {type(values).__name__}; it must be an array of three channels, such as mitsuba.Color3f")
        if dr.width(values) != len(self.nodes):
            raise InputError(f"values has {dr.width(values)} entries a channel; it must have {len(self.nodes)}, one a node")
        return dr.custom(_At, values, self)
