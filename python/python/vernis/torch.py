"""Distances between BRDFs as losses of PyTorch.

Importing this module imports torch. On the CPU; values on another device are brought there and their gradient is taken back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from ._brdf import BrdfLike
from ._errors import InputError
from ._metric import MetricLike, Nodes, Prepared, differentiable

__all__ = ["Distance"]


class _At(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: torch.Tensor, prepared: Prepared, as_loss: bool) -> torch.Tensor:
        array = values.detach().to("cpu", torch.float64).numpy()
        batch = array.reshape(-1, *array.shape[-2:])
        found = [prepared.value_and_grad(one, as_loss=as_loss) for one in batch]
        gradients = np.stack([gradient for _, gradient in found]).reshape(array.shape)
        ctx.save_for_backward(torch.from_numpy(gradients).to(values.device, values.dtype))
        distances = np.array([value for value, _ in found]).reshape(array.shape[:-2])
        return torch.from_numpy(distances).to(values.device, values.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        (gradients,) = ctx.saved_tensors
        return gradients * upstream[..., None, None], None, None


class Distance(torch.nn.Module):
    """The distance to a reference as a differentiable function of a candidate's values.

    Parameters
    ----------
    metric : str, path or Metric
        A metric with a gradient.
    reference : str, Brdf or function
    as_loss : bool
        What a fit minimises in place of the distance, see `Prepared.value_and_grad`.

    Attributes
    ----------
    wi, wo : Tensor of float64, shape (n, 3)
        The directions at which to evaluate the candidate: towards the light and towards the viewer. Buffers of the module: ``to``
        moves them and changes their type.

    Notes
    -----
    ``distance(values)`` takes linear RGB, 1/sr, cosine not included, of shape (n, 3) or (batch, n, 3), float32 or float64, and gives a
    scalar or a tensor of shape (batch,) of the same type. The gradient is exact; second derivatives are refused. It works in training
    loops that are not compiled by ``torch.compile``.

    Examples
    --------
    >>> import vernis, vernis.torch
    >>> distance = vernis.torch.Distance("vernis-loss", vernis.model("lambert", kd=0.2))
    >>> values = torch.full((len(distance.wi), 3), 0.05, requires_grad=True)
    >>> distance(values).backward()
    """

    wi: torch.Tensor
    wo: torch.Tensor

    def __init__(self, metric: MetricLike, reference: BrdfLike, as_loss: bool = False) -> None:
        super().__init__()
        self.prepared = differentiable(metric, reference)
        self.as_loss = as_loss
        nodes = self.nodes
        self.register_buffer("wi", torch.tensor(nodes.wi), persistent=False)
        self.register_buffer("wo", torch.tensor(nodes.wo), persistent=False)

    @property
    def nodes(self) -> Nodes:
        """The directions as NumPy arrays."""
        return self.prepared.nodes

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """The distance of one candidate, or those of a batch: what calling the module gives."""
        if not isinstance(values, torch.Tensor):
            raise InputError(f"values is a {type(values).__name__}; it must be a Tensor")
        if not values.dtype.is_floating_point:
            raise InputError(f"values has the dtype {values.dtype}; it must be float32 or float64")
        expected = (len(self.nodes), 3)
        if values.ndim not in (2, 3) or tuple(values.shape[-2:]) != expected:
            raise InputError(f"values has the shape {tuple(values.shape)}; it must be {expected} or (batch, {expected[0]}, 3)")
        return _At.apply(values, self.prepared, self.as_loss)
