"""Many metrics on one pair, and metrics on many pairs."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from . import _vernis
from ._brdf import Brdf, BrdfLike, as_brdf, data_folder
from ._errors import InputError
from ._metric import Metric, MetricLike, metric
from ._progress import ProgressLike, reporter

__all__ = ["compare", "score"]

#: The metric that is used where none is named.
DEFAULT = "vernis"


def _chosen(names: MetricLike | Iterable[MetricLike]) -> list[Metric]:
    names = [names] if isinstance(names, (str, os.PathLike, Metric)) else list(names)
    found: dict[str, Metric] = {}
    for name in names:
        is_name = isinstance(name, str) and not name.endswith(".json")
        members: list[MetricLike] = list(_vernis.resolve(str(name))) if is_name else [name]
        for one in map(metric, members):
            known = found.setdefault(one.name, one)
            if known is not one and not (is_name or known._source == one._source):
                raise InputError(f"{name}: its metric is called {one.name!r}, and so is another one that was asked for; ask for only one")
    if not found:
        raise InputError("metrics is empty; name at least one")
    return list(found.values())


def compare(
    reference: BrdfLike,
    candidate: BrdfLike,
    metrics: MetricLike | Iterable[MetricLike] = DEFAULT,
    data: Any = None,
) -> dict[str, float]:
    """The distances of a pair under any number of metrics.

    Parameters
    ----------
    reference, candidate : str, Brdf or function
        Notations, BRDFs, or functions (wi, wo) -> values.
    metrics : str, Metric, or several
        ``"all-lp"`` stands for the 36 of the study.
    data : path, optional
        Folder that relative notations are looked up in.

    Returns
    -------
    dict of str to float
        Names of metrics and distances, in the order of `metrics`.
    """
    pair = as_brdf(reference, "reference", data), as_brdf(candidate, "candidate", data)
    chosen = _chosen(metrics)
    [(found, reason)] = _vernis.distances([m._handle for m in chosen], [(pair[0]._handle, pair[1]._handle)], None)
    if reason is not None:
        raise InputError(reason)
    return {m.name: parts[0] for m, parts in zip(chosen, found)}


def score(
    rows: Any,
    metrics: MetricLike | Iterable[MetricLike] = DEFAULT,
    *,
    reference: str = "reference",
    candidate: str = "candidate",
    errors: str = "raise",
    data: Any = None,
    progress: ProgressLike = None,
) -> dict[str, Any]:
    """Scores many pairs on all cores.

    Parameters
    ----------
    rows : iterable of (reference, candidate), dict of columns, or a pandas or polars frame
        Each entry is a notation, a Brdf, or a function.
    metrics : str, Metric, or several
    reference, candidate : str
        Names of the two columns, where `rows` has columns.
    errors : {"raise", "nan"}
        What to do with a pair that cannot be compared: raise, or give NaN and the reason in the column ``"reason"``. A file that is
        not there is found before any work.
    data : path, optional
        Folder that relative notations are looked up in.
    progress : bool or callable, optional
        True for a bar of tqdm, or a function (stage, done, total).

    Returns
    -------
    dict of str to ndarray of float64
        One column a metric, in the order of `rows`; for learned metrics also ``mos``, ``mos_low`` and ``mos_high``, with
        ``:NAME`` behind them for all but the first. ``pandas.DataFrame(result)`` and ``polars.DataFrame(result)`` take it as it is.

    Notes
    -----
    Pairs of one reference share the work for it, and a file of many rows is opened once as long as it is among the last
    `_MOST_OPEN` that were used: memory does not grow with the number of files.
    """
    if errors not in ("raise", "nan"):
        raise InputError(f"errors is {errors!r}; it must be 'raise' or 'nan'")
    pairs = _pairs(rows, reference, candidate)
    chosen = _chosen(metrics)
    sources = _Opened(data, keep_faults=errors == "nan")
    for row, pair in enumerate(pairs):
        for source, what in zip(pair, (reference, candidate)):
            sources.look(source, f"row {row}: {what}")
    reasons = [""] * len(pairs)
    found: list[tuple[int, Any]] = []
    with reporter(progress) as report:
        for rows_of_batch in _batches([(sources.key(a), sources.key(b)) for a, b in pairs]):
            ready = []
            for row in rows_of_batch:
                pair = pairs[row]
                opened = [sources.open(s, f"row {row}: {what}") for s, what in zip(pair, (reference, candidate))]
                if isinstance(opened[0], Brdf) and isinstance(opened[1], Brdf):
                    ready.append((row, opened[0], opened[1]))
                else:
                    reasons[row] = next(reason for reason in opened if isinstance(reason, str))
            told = _counting(report, len(found), len(pairs))
            measured = _vernis.distances([m._handle for m in chosen], [(a._handle, b._handle) for _, a, b in ready], told)
            found.extend((row, one) for (row, _, _), one in zip(ready, measured))
    columns: dict[str, Any] = {m.name: np.full(len(pairs), np.nan) for m in chosen}
    for row, (parts, reason) in sorted(found, key=lambda one: one[0]):
        if reason is not None:
            if errors == "raise":
                raise InputError(f"row {row} of the pairs: {reason}")
            reasons[row] = reason
            continue
        scored = 0
        for m, (value, predicted, _) in zip(chosen, parts):
            columns[m.name][row] = value
            if predicted is not None:
                suffix = f":{m.name}" if scored else ""
                scored += 1
                for name, number in zip(("mos", "mos_low", "mos_high"), predicted):
                    columns.setdefault(name + suffix, np.full(len(pairs), np.nan))[row] = number
    if errors == "nan":
        columns["reason"] = np.array(reasons, dtype=object)
    return columns


#: BRDFs of files that `score` holds at a time. A MERL table takes 19 MB, a full Titopo table 38 MB.
_MOST_OPEN = 32


class _Opened:
    """The BRDFs of many pairs: each is opened when it is needed, and the last `_MOST_OPEN` of files are kept."""

    def __init__(self, data: Any, keep_faults: bool) -> None:
        self.data, self.keep_faults = data, keep_faults
        self.files: OrderedDict[str, Brdf] = OrderedDict()
        # What takes no memory that the caller does not hold already, and why what cannot be opened cannot.
        self.others: dict[Any, Brdf | str] = {}

    @staticmethod
    def key(source: Any) -> Any:
        """What is the same for the same BRDF: text for those of files."""
        return os.fspath(source) if isinstance(source, (str, os.PathLike)) else id(source)

    def look(self, source: Any, what: str) -> None:
        """Finds a file that is not there, or what is no BRDF, before the work."""
        key = self.key(source)
        if key in self.others:
            return
        if isinstance(key, str):
            self._try(key, what, lambda: _vernis.locate(key, data_folder(self.data)))
        else:
            self._try(key, what, lambda: as_brdf(source, what))

    def open(self, source: Any, what: str) -> Brdf | str:
        """The BRDF, or why there is none."""
        key = self.key(source)
        if key in self.others:
            return self.others[key]
        if key not in self.files:
            found = self._try(key, what, lambda: as_brdf(source, what, self.data))
            if not isinstance(found, Brdf):
                return self.others[key]
            while len(self.files) >= _MOST_OPEN:
                self.files.popitem(last=False)
            self.files[key] = found
        self.files.move_to_end(key)
        return self.files[key]

    def _try(self, key: Any, what: str, work: Callable[[], Any]) -> Any:
        try:
            found = work()
        except Exception as error:
            if not self.keep_faults:
                # Python 3.11 and later.
                if hasattr(error, "add_note"):
                    error.add_note(what)
                raise
            self.others[key] = str(error)
            return None
        if not isinstance(key, str):
            self.others[key] = found
        return found


def _batches(keys: list[tuple[Any, Any]]) -> Iterator[list[int]]:
    """The rows of `keys` in batches that need at most `_MOST_OPEN` files, those of one reference after each other."""
    by_reference: dict[Any, list[int]] = {}
    for row, (reference, _) in enumerate(keys):
        by_reference.setdefault(reference, []).append(row)
    batch: list[int] = []
    files: set[str] = set()
    for row in (row for rows in by_reference.values() for row in rows):
        more = files | {key for key in keys[row] if isinstance(key, str)}
        if batch and len(more) > _MOST_OPEN:
            yield batch
            batch, more = [], {key for key in keys[row] if isinstance(key, str)}
        batch.append(row)
        files = more
    if batch:
        yield batch


def _counting(report: Callable[[str, int, int], Any] | None, before: int, total: int) -> Callable[[str, int, int], Any] | None:
    """A callback that counts on from the pairs of earlier batches."""
    return None if report is None else lambda stage, done, _: report(stage, before + done, total)


def _pairs(rows: Any, reference: str, candidate: str) -> list[tuple[Any, Any]]:
    """The pairs of rows, of a dict of columns, or of a frame."""
    names: Any = getattr(rows, "columns", None)
    if isinstance(rows, Mapping) or names is not None:
        names = [str(name) for name in (rows if isinstance(rows, Mapping) else names)]
        for name in (reference, candidate):
            if name not in names:
                raise InputError(f"rows has no column {name!r}; its columns are {', '.join(map(str, names))}")
        columns = [list(rows[name]) for name in (reference, candidate)]
        if len(columns[0]) != len(columns[1]):
            raise InputError(f"the columns {reference!r} and {candidate!r} have {len(columns[0])} and {len(columns[1])} rows")
        return list(zip(*columns))
    pairs = []
    for place, row in enumerate(rows):
        if isinstance(row, Mapping):
            if reference not in row or candidate not in row:
                raise InputError(f"row {place} has no {reference!r} or no {candidate!r}")
            pairs.append((row[reference], row[candidate]))
            continue
        if isinstance(row, str) or not hasattr(row, "__len__") or len(row) != 2:
            raise InputError(f"row {place} is {row!r}; it must be a pair (reference, candidate), or a dict with both")
        pairs.append((row[0], row[1]))
    return pairs
