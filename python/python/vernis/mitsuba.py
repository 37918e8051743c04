"""BSDFs of Mitsuba 3 as BRDFs of vernis.

Importing this module imports mitsuba; set its variant first, ``mitsuba.set_variant("llvm_ad_rgb")``.

Mitsuba's conventions are not those of vernis: its ``wi`` is towards the viewer and its ``wo`` towards the light, and its ``eval`` includes
the cosine of the angle between normal and light. The functions here change both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ._brdf import Brdf
from ._errors import InputError

__all__ = ["brdf", "load", "values"]


def load(source: Any) -> Any:
    """A BSDF from an object, a dictionary, or a fragment of XML. A variant in RGB is needed."""
    if not mi.variant() or not mi.is_rgb:
        raise InputError(f"the variant of Mitsuba is {mi.variant()}; vernis works in RGB: set one such as llvm_ad_rgb first")
    if isinstance(source, Mapping):
        source = mi.load_dict(dict(source))
    elif isinstance(source, str):
        source = mi.load_string(source)
    if not isinstance(source, mi.BSDF):
        raise InputError(f"bsdf is a {type(source).__name__}; it must be a BSDF of Mitsuba, its dictionary, or its XML")
    return source


def values(bsdf: Any, wi: Any, wo: Any) -> Any:
    """The values of a BSDF at directions of vernis, as a ``mitsuba.Color3f`` that derivatives pass through.

    Parameters
    ----------
    bsdf : mitsuba.BSDF
    wi, wo : ndarray, shape (n, 3)
        Unit vectors towards the light and towards the viewer.

    Returns
    -------
    mitsuba.Color3f of n entries
        Linear RGB, 1/sr, cosine not included.
    """
    bsdf = load(bsdf)
    light, viewer = (mi.Vector3f(*(mi.Float(np.ascontiguousarray(w[:, k])) for k in range(3))) for w in (wi, wo))
    interaction = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    interaction.wi = viewer
    interaction.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    interaction.n = mi.Normal3f(0, 0, 1)
    # Some BSDFs look at derivatives of the surface, or at where on it they are.
    interaction.dp_du, interaction.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    interaction.uv = mi.Point2f(0.5, 0.5)
    interaction.wavelengths = dr.zeros(mi.Color0f) if hasattr(mi, "Color0f") else []
    with_cosine = bsdf.eval(mi.BSDFContext(), interaction, light)
    return mi.Color3f(with_cosine) / light.z


def brdf(bsdf: Any, name: str | None = None) -> Brdf:
    """A BSDF of Mitsuba as a BRDF: its reflection above the surface, isotropic.

    Parameters
    ----------
    bsdf : mitsuba.BSDF, dict or str
        An object, a dictionary for ``mitsuba.load_dict``, or XML for ``mitsuba.load_string``.
    name : str, optional
        What it is called; by default the name of its class.
    """
    loaded = load(bsdf)
    scalar = mi.variant().startswith("scalar")

    def one(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        interaction = mi.SurfaceInteraction3f()
        interaction.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
        interaction.n = mi.Normal3f(0, 0, 1)
        interaction.wi = mi.Vector3f(*wo.tolist())
        return np.array(loaded.eval(mi.BSDFContext(), interaction, mi.Vector3f(*wi.tolist()))) / wi[2]

    def function(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        if scalar:
            return np.array([one(a, b) for a, b in zip(wi, wo)]).reshape(-1, 3)
        with dr.suspend_grad():
            found = values(loaded, wi, wo)
            dr.eval(found)
            return np.stack([np.broadcast_to(np.asarray(channel), len(wi)) for channel in found], axis=-1)

    # Colours of `measured` may lie outside the gamut of the primaries.
    signed = "Measured" in str(loaded)
    return Brdf.from_function(function, name or type(loaded).__name__, signed=signed)
