"""Progress of long work: a callback, or a bar where tqdm is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Union

from ._errors import InputError

#: None for silence, True for a bar, or ``callback(stage, done, total)``, total being 0 where it is not known.
ProgressLike = Union[None, bool, Callable[[str, int, int], Any]]


@contextmanager
def reporter(progress: ProgressLike) -> Iterator[Callable[[str, int, int], Any] | None]:
    """What the extension calls, at most twenty times a second."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError("progress is True, which needs tqdm; install it, or pass a function (stage, done, total)") from None
        with tqdm() as bar:

            def show(stage: str, done: int, total: int) -> None:
                bar.set_description_str(stage)
                bar.total = total or None
                bar.n = done
                bar.refresh()

            yield show
    elif callable(progress):
        yield progress
    else:
        raise InputError(f"progress is {progress!r}; it must be None, True, or a function (stage, done, total)")
