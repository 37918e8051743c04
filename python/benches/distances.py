"""How fast values on nodes are scored: batches on one and on two threads, and gradients beside values.

    python python/benches/distances.py [--batch 64] [--rounds 5]

Threads are limited by the variable RAYON_NUM_THREADS, which a process reads once: every figure comes from a process of its own that this
script starts. The processes of one and of two threads take turns, and of each the fastest round counts, so that other work on the
machine disturbs the ratios as little as can be. Only ratios within one run mean anything.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

METRICS = ("vernis", "vernis-loss", "D4.Cl.CR", "ot")
#: Members of a batch for metrics on full tables, which are a hundred times larger.
FEW = 4


def fastest(work: Callable[[], Any], rounds: int = 3) -> float:
    """Seconds of the fastest round."""
    found = float("inf")
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        found = min(found, time.perf_counter() - began)
    return found


def measure(batch: int) -> dict[str, dict[str, float]]:
    """Seconds by metric, in this process: a member of a batch, one value, and one value with its gradient."""
    import numpy as np

    import vernis

    reference = vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.1)
    candidate = vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.2)
    seconds = {}
    for name in METRICS:
        prepared = vernis.metric(name).prepare(reference)
        values = prepared.evaluate(candidate)
        members = batch if len(values) < 100_000 else FEW
        many = np.stack([values] * members)
        prepared.distance(values)
        seconds[name] = {
            "member": fastest(lambda p=prepared, v=many: p.distances(v)) / members,
            "value": fastest(lambda p=prepared, v=values: p.distance(v)),
            "gradient": fastest(lambda p=prepared, v=values: p.value_and_grad(v)),
        }
    return seconds


def with_threads(threads: int, batch: int) -> dict[str, dict[str, float]]:
    """The same in a new process with so many threads."""
    command = [sys.executable, __file__, "--here", "--batch", str(batch)]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: dict[str, dict[str, float]] = json.loads(done.stdout)
    return found


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description="Ratios of Prepared.distances on 1 and 2 threads, and of value_and_grad to a value.")
    parser.add_argument("--batch", type=int, default=64, help="members of a batch")
    parser.add_argument("--rounds", type=int, default=5, help="processes for each number of threads")
    parser.add_argument("--here", action="store_true", help="print the seconds of this process as JSON")
    arguments = parser.parse_args()
    if arguments.here:
        print(json.dumps(measure(arguments.batch)))
        return
    # On a machine that is busy with other work two threads get little more than one.
    busy = f"; load before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores" if hasattr(os, "getloadavg") else ""
    best: dict[tuple[int, str, str], float] = {}
    for _ in range(arguments.rounds):
        for threads in (1, 2):
            for name, seconds in with_threads(threads, arguments.batch).items():
                for what, value in seconds.items():
                    key = threads, name, what
                    best[key] = min(value, best.get(key, float("inf")))
    print(f"batch of {arguments.batch} ({FEW} for tables), fastest of {arguments.rounds} processes; milliseconds{busy}")
    print(f"{'metric':12s} {'1 thread':>9s} {'2 threads':>10s} {'ratio':>6s}   {'value':>8s} {'gradient':>9s} {'ratio':>6s}  (1 thread)")
    for name in METRICS:
        one, two = best[1, name, "member"], best[2, name, "member"]
        value, gradient = best[1, name, "value"], best[1, name, "gradient"]
        print(
            f"{name:12s} {1e3 * one:9.2f} {1e3 * two:10.2f} {one / two:6.2f}   "
            f"{1e3 * value:8.2f} {1e3 * gradient:9.2f} {gradient / value:6.2f}"
        )


if __name__ == "__main__":
    main()
