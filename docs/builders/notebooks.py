"""The tutorials as notebooks: their text, their programs, their commands.

A program that is kept as a file is a cell that writes the file. Where that is a model, the next
cell shows it.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import kincompile
from docs.builders.lessons import MATH
from docs.builders.places import DOCS, EXAMPLES

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER = EXAMPLES / "notebooks"
TUTORIALS = ("jacobian", "linkage", "teaching")

BLOCK = re.compile(
    r"(?:^<!-- file: (?P<file>\S+) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```\n",
    re.MULTILINE | re.DOTALL,
)

INSTALL = f"""# In a browser (JupyterLite): the wheel that lies in the course folder
import sys

if sys.platform == "emscripten":
    import micropip

    await micropip.install("emfs:../kincompile-{kincompile.__version__}-py3-none-any.whl")"""

METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a notebook.

    Attributes
    ----------
    source
        What stands in it.
    is_code
        Whether it is run.
    output
        What the tutorial says that it prints, `...` for anything; None where it does not say.
    """

    source: str
    is_code: bool = True
    output: str | None = None


def notebooks() -> dict[str, str]:
    """Return the text of each notebook by the name of its file."""
    return {f"{name}.ipynb": _as_json(cells(name)) for name in TUTORIALS}


def cells(name: str) -> list[Cell]:
    """Return the cells of a tutorial."""
    return _cells((DOCS / "tutorials" / f"{name}.md").read_text(encoding="utf-8"))


def of_lesson(text: str) -> str:
    """Return a lesson as a notebook, which runs in a browser (JupyterLite) too."""
    text = MATH.sub(r"$$\n\1$$", text)
    text = re.sub(r"^<!-- (?!file: ).*? -->\n|^!\[.*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"\]\((\w+)\.md\)", r"](../\1/notebook.ipynb)", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\.md[^)]*\)", r"\1", text)
    return _as_json([Cell(INSTALL), *_cells(text)])


def _cells(text: str) -> list[Cell]:
    found: list[Cell] = []
    end = 0
    for block in BLOCK.finditer(text):
        if between := text[end : block.start()].strip():
            found.append(Cell(_links(between), is_code=False))
        if block["language"] == "text" and not block["file"]:
            found[-1] = Cell(found[-1].source, output=block["text"])
        else:
            found += _cells_of(block)
        end = block.end()
    return [*found, Cell(_links(text[end:].strip()), is_code=False)]


def _cells_of(block: re.Match[str]) -> Iterator[Cell]:
    """Yield the cells of a program, of a file or of commands."""
    file, text = block["file"], block["text"].rstrip("\n")
    if file:
        yield Cell(f"%%writefile {file}\n{text}")
        if re.search(r"kc\.(Mechanism|Sketch)\(", text):
            yield Cell(f'import kincompile as kc\n\nkc.read_model("{file}")')
    elif block["language"] == "python":
        yield Cell(text)
    else:
        for command in re.split(r"^\$ ", block["text"], flags=re.MULTILINE)[1:]:
            line, _, output = command.partition("\n")
            plain = " | cat" if " compare " in line else ""  # a table in colours elsewhere
            yield Cell(f"!{line}{plain}", output=output)


def _links(text: str) -> str:
    """Return a text of docs/tutorials with the links of examples/notebooks."""
    return text.replace("](../", "](../../docs/")


def _as_json(found: list[Cell]) -> str:
    def cell(item: Cell) -> dict[str, Any]:
        shared = {"metadata": {}, "source": item.source.splitlines(keepends=True)}
        if not item.is_code:
            return {"cell_type": "markdown", **shared}
        return {"cell_type": "code", "execution_count": None, "outputs": [], **shared}

    book = {"cells": [*map(cell, found)], "metadata": METADATA, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(book, indent=1, ensure_ascii=False) + "\n"
