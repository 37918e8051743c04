"""Agreement of metrics with ratings on part of the methods, from the benchmark.json of `vernis train` or `vernis benchmark`.

    python experiments/stimuli/agreement.py out/open/benchmark.json --without BAGHER DUPUY [--metrics vernis D9.Cl 'stimulus[ssim]']

Prints Spearman correlations: of a distance with the rating, or, for learned metrics, of the score that was predicted out of fold. Intervals contain 95 % of
bootstrap resamples of the groups of materials. Needs the standard library alone.
"""

import argparse
import json
import random
from pathlib import Path


def ranks(values):
    order = sorted(range(len(values)), key=values.__getitem__)
    found = [0.0] * len(values)
    start = 0
    while start < len(order):
        end = start
        while end + 1 < len(order) and values[order[end + 1]] == values[order[start]]:
            end += 1
        for place in order[start : end + 1]:
            found[place] = 0.5 * (start + end)
        start = end + 1
    return found


def spearman(a, b):
    a, b = ranks(a), ranks(b)
    mean = (len(a) - 1) / 2
    covariance = sum((x - mean) * (y - mean) for x, y in zip(a, b))
    return covariance / (sum((x - mean) ** 2 for x in a) * sum((y - mean) ** 2 for y in b)) ** 0.5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("record", type=Path)
    parser.add_argument("--without", nargs="*", default=[], metavar="METHOD")
    parser.add_argument("--metrics", nargs="*", metavar="NAME", help="all metrics by default")
    parser.add_argument("--resamples", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    record = json.loads(given.record.read_text())
    rows = [row for row in record["predictions"] if row["method"] not in given.without]
    groups = {}
    for place, row in enumerate(rows):
        groups.setdefault(row["group"], []).append(place)
    groups = list(groups.values())
    generator = random.Random(given.seed)
    draws = [[place for group in generator.choices(groups, k=len(groups)) for place in group] for _ in range(given.resamples)]
    rated = [row["mos"] for row in rows]
    # A distance grows as the rating falls. Of a metric that has both, it is the distance that counts.
    sides = [("predicted", 1), ("distances", -1)]
    known = {name: (side, sign) for side, sign in sides for name in rows[0].get(side, {})}
    found = []
    for name in given.metrics or known:
        side, sign = known[name]
        values = [sign * row[side][name] for row in rows]
        replicates = sorted(spearman([values[p] for p in draw], [rated[p] for p in draw]) for draw in draws)
        low, high = (replicates[int(q * (len(replicates) - 1))] for q in (0.025, 0.975))
        found.append((spearman(values, rated), low, high, name))
    left_out = f" without {', '.join(given.without)}" if given.without else ""
    print(f"{record['study']}: {len(rows)} of {len(record['predictions'])} rated pairs{left_out}\n")
    print("| metric | SROCC [95 % interval by group of materials] |\n| :--- | ---: |")
    for value, low, high, name in sorted(found, reverse=True):
        print(f"| {name} | {value:.3f} [{low:.3f}, {high:.3f}] |")


if __name__ == "__main__":
    main()
