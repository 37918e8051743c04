"""BRDFs: opened from files, built from models, made from tables and functions."""

from __future__ import annotations

import base64
import html
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

import numpy as np

from . import _arrays, _vernis
from ._errors import InputError

__all__ = ["Brdf", "Grid", "Model", "Parameter", "Table", "model", "models", "open"]

#: Pixels a side of the sphere in notebooks.
_SIDE = 96
#: And of the largest picture, which takes 400 MB while it is made.
_LARGEST = 192


@dataclass(frozen=True)
class Grid:
    """The cells of a table of a BRDF.

    Parameters
    ----------
    kind : {"half-difference", "standard"}
        The coordinates: `(theta_h, theta_d, phi_d)` of MERL, with rows spaced by the square root along the first, or
        `(theta_i, theta_o, phi_d)` with `phi_i = 0`.
    shape : tuple of int
        Number of cells along each axis.
    anchor : {"edge", "centre"}, optional
        For standard coordinates: where in its cell a value belongs.

    Notes
    -----
    A grid is never guessed from the shape of an array: the same shape may mean several grids.
    """

    kind: str
    shape: tuple[int, int, int]
    anchor: str | None = None

    def __post_init__(self) -> None:
        allowed = {"half-difference": (None,), "standard": ("edge", "centre")}
        if self.kind not in allowed:
            raise InputError(f"kind is {self.kind!r}; it must be 'half-difference' or 'standard'")
        if self.anchor not in allowed[self.kind]:
            choices = " or ".join(map(repr, allowed[self.kind]))
            raise InputError(f"anchor is {self.anchor!r}; for a {self.kind} grid it must be {choices}")
        shape = tuple(self.shape)
        if len(shape) != 3 or any(not isinstance(n, (int, np.integer)) or n < 1 for n in shape):
            raise InputError(f"shape is {self.shape!r}; it must be three numbers of cells, each at least 1")
        if np.prod([float(n) for n in shape]) > 2**31:
            raise InputError(f"shape is {self.shape!r}; a table has at most 2**31 cells")
        object.__setattr__(self, "shape", tuple(int(n) for n in shape))

    @classmethod
    def merl(cls, full: bool = False) -> Grid:
        """The MERL grid, 90 x 90 x 180, or 90 x 90 x 360 if `full`, for BRDFs that are not reciprocal."""
        return cls("half-difference", (90, 90, 360 if full else 180))

    @classmethod
    def titopo(cls, half: bool = False) -> Grid:
        """The Titopo grid, 90 x 90 x 360 with values at lower cell edges, or 45 x 45 x 180 if `half`."""
        return cls("standard", (45, 45, 180) if half else (90, 90, 360), "edge")

    @classmethod
    def standard(cls, theta_i: int, theta_o: int, phi_d: int, anchor: str = "centre") -> Grid:
        """A grid in standard coordinates with values at the `"centre"` or the `"edge"` of cells."""
        return cls("standard", (theta_i, theta_o, phi_d), anchor)

    def __len__(self) -> int:
        return self.shape[0] * self.shape[1] * self.shape[2]

    def directions(self) -> tuple[_arrays.Floats, _arrays.Floats]:
        """The directions at which the values of the cells belong.

        Returns
        -------
        wi, wo : ndarray of float64, shape (n, 3)
            Towards the light and towards the viewer, in the order of ``values.reshape(n, 3)``. On half/difference grids some lie
            below the horizon.
        """
        return _vernis.directions(self._parts())

    def _parts(self) -> tuple[str, list[int], str | None]:
        return self.kind, list(self.shape), self.anchor


class Brdf:
    """An isotropic bidirectional reflectance distribution function.

    Made by `open`, `model`, `Table`, or from a function by `Brdf.from_function`. Calling it gives values.

    Attributes
    ----------
    notation : str or None
        What it was opened from, in the notation of sources.
    """

    __slots__ = ("_data", "_handle", "_name", "notation")

    notation: str | None
    _data: Any
    _handle: _vernis.Brdf
    _name: str

    def __init__(self) -> None:
        raise TypeError("a Brdf is made by vernis.open, vernis.model, vernis.Table or Brdf.from_function")

    @classmethod
    def _of(cls, handle: _vernis.Brdf, name: str, notation: str | None = None, data: Any = None) -> Brdf:
        brdf = object.__new__(Brdf)
        brdf._handle, brdf._name, brdf.notation, brdf._data = handle, name, notation, data
        return brdf

    @classmethod
    def from_function(cls, function: Callable[..., Any], name: str | None = None, signed: bool = False) -> Brdf:
        """A BRDF that is a function of arrays.

        Parameters
        ----------
        function : callable
            ``function(wi, wo)`` of two float64 arrays of shape (n, 3), unit directions towards light and viewer above the horizon, +z
            being the normal, which returns real values of shape (n, 3): linear RGB, 1/sr, cosine not included, finite and not
            negative. It may be called from several threads, one at a time, with any n.
        name : str, optional
            What it is called in messages; by default the name of the function.
        signed : bool
            Components below zero are colours outside the gamut of the primaries, and no fault: metrics take them as 0.

        Notes
        -----
        An exception that the function raises arrives unchanged at the caller of whatever needed the values. Metrics evaluate
        thousands to millions of directions: a function that works on arrays is a hundred times faster than a loop.
        """
        if not callable(function):
            raise InputError(f"function is a {type(function).__name__}; it must be callable")
        called = str(name or getattr(function, "__name__", type(function).__name__))

        def values(wi: _arrays.Floats, wo: _arrays.Floats) -> _arrays.Floats:
            found = _arrays.real(function(wi, wo), f"what {called} returned")
            if found.shape != wi.shape:
                raise InputError(f"{called} returned the shape {found.shape} for directions of shape {wi.shape}; it must be the same")
            return np.ascontiguousarray(found, dtype=np.float64)

        return cls._of(_vernis.Brdf.function(values, signed), called)

    def __call__(self, wi: Any, wo: Any) -> _arrays.Floats:
        """Values at pairs of directions.

        Parameters
        ----------
        wi, wo : array_like, shape (..., 3)
            Unit vectors towards the light and towards the viewer, +z being the normal. They are broadcast against each other.

        Returns
        -------
        ndarray of float64, shape (..., 3)
            Linear RGB, 1/sr, cosine not included; 0 below the horizon, NaN where a measurement is missing.
        """
        wi, wo = _arrays.directions(wi, "wi"), _arrays.directions(wo, "wo")
        try:
            wi, wo = np.broadcast_arrays(wi, wo)
        except ValueError:
            raise InputError(f"wi has the shape {wi.shape} and wo {wo.shape}; they must be the same but for axes of 1") from None
        flat = [np.ascontiguousarray(w.reshape(-1, 3)) for w in (wi, wo)]
        return self._handle.evaluate(*flat).reshape(wi.shape)

    @property
    def name(self) -> str:
        """What it is called: the notation, the model, or the name of the function."""
        return self._name

    @property
    def model(self) -> str | None:
        """The identifier of the model, such as ``"ggx"``; None for what is no model."""
        return self._handle.model_name

    @property
    def parameters(self) -> dict[str, float | list[float]] | None:
        """The parameters of the model by name, colours as three numbers; None for what is no model."""
        found = self._handle.parameters
        if found is None:
            return None
        return {name: values[0] if len(values) == 1 else list(values) for name, values in found}

    @property
    def grid(self) -> Grid | None:
        """The grid of the table; None for what is no table."""
        found = self._handle.grid
        if found is None:
            return None
        kind, (a, b, c), anchor = found
        return Grid(kind, (a, b, c), anchor)

    @property
    def description(self) -> str | None:
        """What its file says of it, if anything."""
        return self._handle.description

    @property
    def sha256(self) -> str | None:
        """SHA-256 of what defines it, for what was opened."""
        return self._handle.content

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a model and its parameters as a ``.json`` file, which the program and `open` read."""
        if self.model is None:
            raise InputError(f"{self.name} is no model; only models can be written as parameters")
        path = Path(path)
        if path.suffix != ".json":
            raise InputError(f"path is {path}; it must end in .json")
        path.write_text(json.dumps({"model": self.model, **(self.parameters or {})}, indent=2) + "\n", encoding="utf-8")

    def png(self, side: int = _SIDE) -> bytes:
        """A picture: a sphere of `side` pixels under lamps, as a PNG file, transparent beside the sphere.

        The first picture of a size takes seconds; later ones up to 96 pixels take milliseconds. For larger pictures use a renderer.
        """
        if not 1 <= side <= _LARGEST:
            raise InputError(f"side is {side}; it must be 1 to {_LARGEST}")
        return self._handle.png(side)

    def __repr__(self) -> str:
        return f"<vernis.Brdf {self.name}>"

    def _repr_html_(self) -> str:
        return figure([self])

    def __reduce__(self) -> tuple[Any, ...]:
        if self.notation is not None:
            return open, (self.notation, self._data)
        if self.model is not None:
            return _model_of, (self.model, self.parameters)
        raise InputError(f"{self.name} cannot be pickled: it is neither a model nor opened from a notation")


def figure(brdfs: list[Brdf]) -> str:
    """Spheres beside each other, each with its name, as HTML."""
    cells = []
    for brdf in brdfs:
        source = base64.b64encode(brdf.png()).decode("ascii")
        name = html.escape(brdf.name)
        cells.append(
            f'<figure style="display:inline-block;margin:0 1em 0 0;text-align:center"><img alt="a sphere of {name}" width="{_SIDE}" '
            f'height="{_SIDE}" src="data:image/png;base64,{source}"/><figcaption>{name}</figcaption></figure>'
        )
    return "".join(cells)


#: What stands for a BRDF wherever one is asked for.
BrdfLike = Union[str, "os.PathLike[str]", Brdf, Callable[..., Any], Mapping[str, Any]]


def as_brdf(source: BrdfLike, what: str, data: Any = None) -> Brdf:
    """A notation, a path, a Brdf, a function, or a BSDF of Mitsuba as a Brdf; `what` is named in errors."""
    if isinstance(source, Brdf):
        return source
    if isinstance(source, str) and source.lstrip().startswith("<") or isinstance(source, Mapping) and "type" in source:
        return _of_mitsuba(source, what)
    if isinstance(source, (str, os.PathLike)):
        return open(source, data)
    if callable(source):
        return Brdf.from_function(source)
    raise InputError(f"{what} is a {type(source).__name__}; it must be a notation, a Brdf, or a function (wi, wo) -> values")


def _of_mitsuba(source: Any, what: str) -> Brdf:
    """A BSDF of Mitsuba, from its dictionary or XML."""
    try:
        from . import mitsuba
    except ImportError as error:
        raise InputError(f"{what} is a BSDF of Mitsuba, and mitsuba cannot be imported ({error}); pip install mitsuba") from error
    return mitsuba.brdf(source)


def data_folder(data: Any) -> str | None:
    """The folder that was named, or that of the variable VERNIS_DATA."""
    folder = os.environ.get("VERNIS_DATA") if data is None else os.fspath(data)
    return folder or None


def open(notation: str | os.PathLike[str], data: str | os.PathLike[str] | None = None) -> Brdf:
    """Opens a BRDF.

    Parameters
    ----------
    notation : str or path
        In the notation of sources: ``PATH.binary`` (MERL), ``PATH.titopo``, ``PATH.bsdf`` (RGL), ``PATH.h5`` (NBRDF),
        ``ARCHIVE.zip:MATERIAL``, ``FILE.fit:MATERIAL[?KEY=VALUE&...]``, ``npf.bin:MATERIAL``, ``MODEL.json``.
    data : path, optional
        Folder that relative paths are looked up in, after the current one; by default that of the variable ``VERNIS_DATA``.

    Raises
    ------
    NotFoundError
        There is no such file.
    UnknownNameError
        The file has no such material; ``nearest`` has those that are similar.
    InputError
        What is there is no BRDF.
    """
    notation = os.fspath(notation)
    if not isinstance(notation, str):
        raise InputError(f"notation is a {type(notation).__name__}; it must be text")
    return Brdf._of(_vernis.Brdf.open(notation, data_folder(data)), notation, notation, data)


def model(name: str, **parameters: Any) -> Brdf:
    """A BRDF from a published model.

    Parameters
    ----------
    name : str
        One of `models`, or a sum such as ``"ggx+ward"``.
    **parameters : float or array_like
        The parameters by name. A colour is three numbers, or one for all channels. Those of a sum have the number of their term: pass
        ``**{"1.kd": 0.2, "2.alpha": 0.1}``.

    Raises
    ------
    UnknownNameError
        There is no such model or parameter.
    InputError
        A parameter is missing, has the wrong number of numbers, or is out of bounds.

    Examples
    --------
    >>> import vernis
    >>> gold = vernis.model("ggx-conductor", kd=0, eta=[0.16, 0.42, 1.45], k=[3.9, 2.4, 1.8], alpha=0.1)
    """
    return _model_of(name, parameters)


def _model_of(name: str, parameters: Mapping[str, Any]) -> Brdf:
    if not isinstance(name, str):
        raise InputError(f"name is a {type(name).__name__}; it must be that of a model, such as 'ggx'")
    counts = _field_counts(name)
    given = []
    for field, value in parameters.items():
        numbers = _arrays.real(value, f"{name}: {field}").astype(np.float64)
        if numbers.ndim > 1:
            raise InputError(f"{name}: {field} has the shape {numbers.shape}; it must be a number or three")
        entries = numbers.reshape(-1).tolist()
        if numbers.ndim == 0 and counts.get(field) == 3:
            entries = entries * 3
        given.append((field, entries))
    return Brdf._of(_vernis.Brdf.model(name, given), name)


def _field_counts(name: str) -> dict[str, int]:
    """How many numbers each field of a model has; empty for a model that does not exist."""
    try:
        return dict(_vernis.fields(name))
    except InputError:
        return {}


@dataclass(frozen=True)
class Parameter:
    """One number of the parameters of a model, such as ``"alpha"``, or ``"kd.r"`` for a channel of a colour.

    Attributes
    ----------
    unit : str
        ``"1"`` for a number without one.
    lower, upper : float
        Bounds.
    start : float
        Of a plain, slightly glossy grey.
    """

    name: str
    unit: str
    lower: float
    upper: float
    start: float


@dataclass(frozen=True)
class Model:
    """A published model: its name and its parameters in order."""

    name: str
    parameters: tuple[Parameter, ...]


def models() -> list[Model]:
    """All models with their parameters, bounds and units."""
    return [Model(name, tuple(Parameter(**p) for p in parameters)) for name, parameters in _vernis.models()]


def Table(values: Any, grid: Grid, valid: Any = None) -> Brdf:
    """A BRDF from a table.

    Parameters
    ----------
    values : array_like of float, shape (a, b, c, 3)
        Linear RGB, 1/sr, cosine not included, kept as float32. NaN in any channel means that the cell was not measured.
    grid : Grid
        The cells; its shape is (a, b, c).
    valid : array_like of bool, shape (a, b, c), optional
        Which cells were measured, beside those that are NaN.

    Raises
    ------
    InputError
        Wrong shape or dtype, a negative or infinite value, no measured cell.
    """
    if not isinstance(grid, Grid):
        raise InputError(f"grid is a {type(grid).__name__}; it must be a vernis.Grid, such as Grid.merl()")
    array = _arrays.real(values, "values")
    if array.shape != (*grid.shape, 3):
        raise InputError(f"values has the shape {array.shape}; for this grid it must be {(*grid.shape, 3)}")
    table = np.ascontiguousarray(array, dtype=np.float32)
    measured = ~np.isnan(table).any(axis=-1)
    if valid is not None:
        mask = np.asarray(valid)
        if mask.dtype != np.bool_ or mask.shape != grid.shape:
            raise InputError(f"valid has the dtype {mask.dtype} and the shape {mask.shape}; it must be bool and {grid.shape}")
        measured &= mask
    handle = _vernis.Brdf.table(table.reshape(-1), np.ascontiguousarray(measured).reshape(-1), grid._parts())
    return Brdf._of(handle, f"table {'x'.join(map(str, grid.shape))}")
