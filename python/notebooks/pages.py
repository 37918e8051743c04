"""Makes the pages of ``docs/python`` from the notebooks beside this file.

    python python/notebooks/pages.py           # runs the notebooks, and writes the pages and their pictures
    python python/notebooks/pages.py --check   # runs nothing: says whether the pages are those of the notebooks as they are

Needs mitsuba and the extra `notebooks` of vernis in the environment of this Python. Notebooks are kept without outputs; what
their cells print and show is in the pages alone.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import re
import sys
import tempfile
from pathlib import Path

import nbformat

HERE = Path(__file__).resolve().parent
NOTEBOOKS = sorted(HERE.glob("*.ipynb"))
PAGES = HERE.parents[1] / "docs" / "python"
COMMAND = "python python/notebooks/pages.py"
INDEX = "README.md"

#: A sphere with its name, as `vernis` shows BRDFs.
_FIGURE = re.compile(r"<figure[^>]*>(<img.*?/>)<figcaption>(.*?)</figcaption></figure>", re.DOTALL)
_PICTURE = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=]+)")


def text_of(cell: nbformat.NotebookNode) -> str:
    """The source of a cell as its page has it: links lead to pages."""
    return cell.source if cell.cell_type == "code" else re.sub(r"\.ipynb\)", ".md)", cell.source)


def title(notebook: nbformat.NotebookNode) -> str:
    """The first heading."""
    return notebook.cells[0].source.splitlines()[0].removeprefix("# ")


def page_of(path: Path) -> Path:
    """Where the page of a notebook is."""
    return PAGES / f"{path.stem}.md"


def make(path: Path) -> None:
    """Runs a notebook, and writes its page and its pictures."""
    from nbclient import NotebookClient
    from nbconvert import MarkdownExporter

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=900, coalesce_streams=True, resources={"metadata": {"path": folder}}).execute()
    for cell in notebook.cells:
        cell.source = text_of(cell)
    resources = {"unique_key": "figure", "output_files_dir": path.stem}
    body, resources = MarkdownExporter().from_notebook_node(notebook, resources)
    files: dict[str, bytes] = dict(resources["outputs"])

    def kept(found: re.Match[str]) -> str:
        content = base64.b64decode(found[1])
        name = f"{path.stem}/{hashlib.sha256(content).hexdigest()[:12]}.png"
        files[name] = content
        return name

    body = re.sub(f"(?:{_FIGURE.pattern})+", lambda figures: _table(figures[0]), body, flags=re.DOTALL)
    body = _PICTURE.sub(kept, body).replace("![png](", "![figure](")
    (PAGES / path.stem).mkdir(parents=True, exist_ok=True)
    for old in (PAGES / path.stem).iterdir():
        old.unlink()
    for name, content in files.items():
        (PAGES / name).write_bytes(content)
    lines = [line.rstrip() for line in body.strip().splitlines()]
    head = f"<!-- Made from python/notebooks/{path.name} by `{COMMAND}`. Edit the notebook, not this page. -->"
    page_of(path).write_text("\n".join([head, "", *lines, ""]), encoding="utf-8")


def _table(figures: str) -> str:
    """Spheres beside each other in a page, whose readers drop styles."""
    cells = "".join(f'<td align="center">{picture}<br/>{name}</td>' for picture, name in _FIGURE.findall(figures))
    return f"<table><tr>{cells}</tr></table>"


def index() -> str:
    """The list of the pages."""
    lines = [
        f"<!-- Made by `{COMMAND}`. -->",
        "",
        "# vernis in Python, step by step",
        "",
        "Each page is a notebook that was run as it stands, on data made by code. The notebooks are in",
        "[`python/notebooks`](../../python/notebooks); a test runs them. [What the package is](../../python/README.md).",
        "",
    ]
    lines += [f"* [{title(nbformat.read(path, as_version=4))}]({path.stem}.md)" for path in NOTEBOOKS]
    lines += ["", f"`{COMMAND}` makes these pages again.", ""]
    return "\n".join(lines)


def faults() -> list[str]:
    """What is wrong with the pages, a sentence each."""
    found = []
    expected = {INDEX}
    if not (PAGES / INDEX).is_file() or (PAGES / INDEX).read_text(encoding="utf-8") != index():
        found.append(f"{PAGES / INDEX} is not the list of the notebooks")
    for path in NOTEBOOKS:
        page = page_of(path)
        expected.add(page.name)
        if not page.is_file():
            found.append(f"{page} is missing")
            continue
        text, place = page.read_text(encoding="utf-8"), 0
        for cell in nbformat.read(path, as_version=4).cells:
            # As in the page, where lines have no spaces at their ends.
            source = "\n".join(line.rstrip() for line in text_of(cell).strip().splitlines())
            at = text.find(f"```python\n{source}\n```" if cell.cell_type == "code" else source, place)
            if at < 0:
                found.append(f"{page} lacks the cell {cell.id} of {path.name}, or has it at another place")
                break
            place = at + len(source)
        pictures = set(re.findall(rf'[("]({re.escape(path.stem)}/[^")]+\.(?:png|svg))[")]', text))
        kept = {f"{path.stem}/{file.name}" for file in (PAGES / path.stem).glob("*")}
        found += [f"{page} shows {name}, which is missing" for name in sorted(pictures - kept)]
        found += [f"{PAGES / name} is shown nowhere" for name in sorted(kept - pictures)]
    found += [f"{page} is of no notebook" for page in sorted(PAGES.glob("*.md")) if page.name not in expected]
    return found


def main() -> int:
    """Makes the pages, or checks them."""
    parser = argparse.ArgumentParser(description="Makes the pages of docs/python from the notebooks.")
    parser.add_argument("--check", action="store_true", help="run nothing: say whether the pages are those of the notebooks")
    parser.add_argument("names", nargs="*", help="only these notebooks, such as 2-fit")
    arguments = parser.parse_args()
    if not arguments.check:
        unknown = set(arguments.names) - {path.stem for path in NOTEBOOKS}
        if unknown:
            parser.error(f"no notebook is called {', '.join(sorted(unknown))}; there are {', '.join(p.stem for p in NOTEBOOKS)}")
        for path in NOTEBOOKS:
            if not arguments.names or path.stem in arguments.names:
                make(path)
        (PAGES / INDEX).write_text(index(), encoding="utf-8")
    found = faults()
    for fault in found:
        print(fault, file=sys.stderr)
    if found and arguments.check:
        print(f"run `{COMMAND}`", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
