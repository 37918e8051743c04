"""The exceptions of vernis.

Every one is an `Error`. Those that Python users expect to be something else as well are: a wrong argument is also a `ValueError`, a
missing file also a `FileNotFoundError`.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["Error", "InputError", "NotFoundError", "UnknownNameError"]


class Error(Exception):
    """What every exception of vernis is; by itself a fault of vernis or of the machine."""


class InputError(Error, ValueError):
    """An argument, or the content of a file, that cannot be: the message says where, what was found, and what is allowed."""


class UnknownNameError(InputError):
    """A name that vernis does not know.

    Attributes
    ----------
    nearest : list of str
        The known names that are most like it, best first; empty where none is.
    """

    def __init__(self, message: str, nearest: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.nearest = list(nearest)


class NotFoundError(Error, FileNotFoundError):
    """A file that is not there."""


for _class in (Error, InputError, UnknownNameError, NotFoundError):
    _class.__module__ = "vernis"
