"""Scoring many pairs: how often files are opened, how many are held, and in which order rows come back."""

from __future__ import annotations

import gc
import weakref
from collections import Counter

import numpy as np
import pytest

import vernis
from vernis import _score


@pytest.fixture
def opened(monkeypatch):
    """How often each file was opened, and the most that were held at a time."""
    counts, alive, most = Counter(), weakref.WeakSet(), [0]
    as_brdf = _score.as_brdf

    class Held:
        """Lives as long as the BRDF."""

    def counting(source, what, data=None):
        brdf = as_brdf(source, what, data)
        if isinstance(source, str):
            counts[source] += 1
            held = Held()
            alive.add(held)
            brdf._data = held
            gc.collect()
            most[0] = max(most[0], len(alive))
        return brdf

    monkeypatch.setattr(_score, "as_brdf", counting)
    return counts, most


@pytest.fixture
def files(tmp_path):
    paths = []
    for number in range(12):
        paths.append(str(tmp_path / f"{number}.json"))
        vernis.model("ggx", kd=0.02 * number + 0.05, f0=0.04, alpha=0.1 + 0.02 * number).save(paths[-1])
    return paths


def test_a_file_of_many_rows_is_opened_once(opened, files) -> None:
    rows = [(a, b) for a in files[:3] for b in files[:3]] * 2
    found = vernis.score(rows, "D9.Cl")["D9.Cl"]
    assert set(opened[0].values()) == {1} and len(opened[0]) == 3
    np.testing.assert_array_equal(found[:9], found[9:])


def test_only_so_many_files_are_held_and_rows_keep_their_order(opened, files, monkeypatch) -> None:
    # Rows of one reference are far from each other.
    rows = [(files[k % 2], files[(7 * k) % 12]) for k in range(24)]
    expected = vernis.score(rows, ["D9.Cl", "vernis"])
    assert opened[1][0] == 12
    opened[0].clear()
    opened[1][0] = 0
    monkeypatch.setattr(_score, "_MOST_OPEN", 4)
    told = []
    found = vernis.score(rows, ["D9.Cl", "vernis"], progress=lambda stage, done, total: told.append((done, total)))
    assert list(found) == list(expected)
    for name, column in expected.items():
        np.testing.assert_array_equal(found[name], column)
    # Those that are kept, those of the batch, and the one that is being opened.
    assert opened[1][0] <= 9 and opened[0][files[0]] == 1
    assert told[-1] == (24, 24) and [done for done, _ in told] == sorted(done for done, _ in told)


def test_a_missing_file_is_found_before_any_work(files, monkeypatch) -> None:
    monkeypatch.setattr(_score, "_MOST_OPEN", 2)
    rows = [(files[0], files[1]), (files[2], files[3]), (files[4], "nothing.binary")]

    def told(*news: object) -> None:
        raise AssertionError("work began")

    with pytest.raises(vernis.NotFoundError, match="nothing.binary") as raised:
        vernis.score(rows, "D9.Cl", progress=told)
    if hasattr(raised.value, "__notes__"):
        assert raised.value.__notes__ == ["row 2: candidate"]
    with pytest.raises(vernis.InputError, match="row 1: reference is a int"):
        vernis.score([rows[0], (3, files[0])], "D9.Cl", progress=told)


def test_rows_that_cannot_be_opened_keep_their_reasons_in_batches(files, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(_score, "_MOST_OPEN", 2)
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    rows = [(files[0], files[1]), (str(broken), files[1]), (files[2], broken), (files[2], "nothing.binary"), (files[2], 3)]
    found = vernis.score(rows, "D9.Cl", errors="nan")
    assert np.isnan(found["D9.Cl"]).tolist() == [False, True, True, True, True]
    assert found["reason"][0] == "" and "nothing.binary" in found["reason"][3] and "int" in found["reason"][4]
    assert found["reason"][1] == found["reason"][2] and "broken.json" in found["reason"][1]
    assert vernis.score([], "D9.Cl")["D9.Cl"].shape == (0,)
