"""The notebooks: each runs as it stands, is kept without outputs, and has the page that was made from it."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="nbclient is not installed")
nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
for package in ("ipykernel", "matplotlib"):
    pytest.importorskip(package, reason=f"{package} is not installed")

PYTHON = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((PYTHON / "notebooks").glob("*.ipynb"))


def needs_mitsuba(path: Path) -> bool:
    return "import mitsuba" in path.read_text(encoding="utf-8")


def without_mitsuba() -> str | None:
    """Why a notebook that uses Mitsuba cannot run here. In a process of its own: an LLVM that is too old aborts."""
    if importlib.util.find_spec("mitsuba") is None:
        return "mitsuba is not installed"
    code = "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; assert dr.sum(dr.arange(mi.Float, 3))[0] == 3"
    works = subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
    return None if works else "no LLVM that Dr.Jit can use"


def test_there_are_notebooks() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["1-compare", "2-fit", "3-mitsuba", "4-train"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    if needs_mitsuba(path) and (reason := without_mitsuba()):
        pytest.skip(reason)
    notebook = nbformat.read(path, as_version=4)
    # Its kernel is this Python, and its folder one that it may fill.
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells)
    shown = [data for cell in cells for output in cell.outputs for data in output.get("data", {})]
    assert "image/png" in shown and "text/html" in shown
    warned = [output.text for cell in cells for output in cell.outputs if output.get("name") == "stderr"]
    assert not warned


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == [] and cell.execution_count is None, cell.id
    assert set(notebook.metadata) <= {"kernelspec", "language_info"}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8")):
        assert target.startswith("https://") or (path.parent / target).exists(), target


def test_the_pages_are_those_of_the_notebooks() -> None:
    done = subprocess.run([sys.executable, PYTHON / "notebooks" / "pages.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
