"""The program: ``vernis`` or ``python -m vernis``."""

from __future__ import annotations

import signal
import sys

from . import _vernis


def main() -> None:
    """Runs the program with the arguments of the process, and exits with its code."""
    # The program handles Ctrl-C itself; Python would only note it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_vernis.main(["vernis", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
