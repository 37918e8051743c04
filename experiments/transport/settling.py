"""How far distances for p = 1 are from what they settle to as clusters of cells get smaller.

    pip install ./python
    python experiments/transport/settling.py DATA [--pairs 20] [--grids 15x15x60,45x45x180]

DATA is the data folder. The pairs are evenly spaced when those of seven methods are ordered by rating. On grids of up to 32,000 cells the reference is the sum
over all pairs of cells; on larger ones it is what 24,000 clusters settle to. Prints the errors of each accuracy, in per cent of the distance, which is the
fourth root of the divergence: errors of the divergence are four times as large. A pair takes three quarters of a minute on two cores; each is printed when it is done.
"""

from __future__ import annotations

import argparse
import csv
import math
import zipfile
from pathlib import Path

import vernis

REFERENCES = "nbrdf/merl_nbrdf.zip"
CANDIDATES = {
    "SGD": "published-fits/bagher_sgd.fit:{}",
    "ABC": "published-fits/low_lowmicrofacet_E2.fit:{}?eta=2.5",
    "BAGHER": "bagher2016-npf/npf.bin:{}",
    "WARD": "published-fits/ngan_ward.fit:{}?model=ward-duer",
    "BLINN-PHONG": "published-fits/ngan_blinnphong.fit:{}",
    "LAFORTUNE": "published-fits/ngan_lafortune.fit:{}",
    "GGX": "nbrdf/merl_nbrdf.zip:{}?fit=dupuy-ggx",
}
ACCURACIES = ("coarse", "fast", "standard")
MOST_CELLS = 32_000


def pairs_of(data: Path, count: int) -> list[tuple[str, str]]:
    """Reference and candidate of `count` rated pairs, evenly spaced by rating."""
    with zipfile.ZipFile(data / REFERENCES) as archive:
        materials = {Path(name).stem for name in archive.namelist()}
    with open(data / "lavoue2021/PerceptualDistances.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter=";") if row["METHOD"] in CANDIDATES and row["BRDF"] in materials]
    rows.sort(key=lambda row: (float(row["DISTANCE"]), row["BRDF"], row["METHOD"]))
    chosen = [rows[int((k + 0.5) / count * len(rows))] for k in range(count)]
    return [(f"{data}/{REFERENCES}:{row['BRDF']}", f"{data}/{CANDIDATES[row['METHOD']].format(row['BRDF'])}") for row in chosen]


def main() -> None:
    """Prints a line a pair and grid, and a summary a grid."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--grids", default="15x15x60,45x45x180")
    args = parser.parse_args()
    pairs = pairs_of(args.data, args.pairs)
    for grid in args.grids.split(","):
        cells = math.prod(map(int, grid.split("x")))
        finest = cells if cells <= MOST_CELLS else 24_000
        reference = f"ot[p=1,grid={grid},clusters={finest}]"
        names = {f"ot[p=1,grid={grid},accuracy={accuracy}]": accuracy for accuracy in ACCURACIES}
        errors: dict[str, list[float]] = {accuracy: [] for accuracy in ACCURACIES}
        for a, b in pairs:
            found = vernis.compare(a, b, [*names, reference])
            for name, accuracy in names.items():
                errors[accuracy].append(100 * (found[name] / found[reference] - 1))
            said = " ".join(f"{accuracy} {errors[accuracy][-1]:+.2f}" for accuracy in ACCURACIES)
            print(f"{grid} {found[reference]:.6f} {said} {b.removeprefix(str(args.data))}", flush=True)
        for accuracy, found_errors in errors.items():
            rms = math.sqrt(sum(e * e for e in found_errors) / len(found_errors))
            mean, worst = sum(found_errors) / len(found_errors), max(found_errors, key=abs)
            print(f"{grid} {accuracy}: mean {mean:+.2f} %, root of the mean square {rms:.2f} %, largest {worst:+.2f} %", flush=True)


if __name__ == "__main__":
    main()
