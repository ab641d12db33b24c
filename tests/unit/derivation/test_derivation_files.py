"""A derivation as HTML, LaTeX, Markdown and a notebook."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.errors import InputError

MOST_BYTES = 2_000_000
BOLD_GAMMA = "\N{MATHEMATICAL BOLD SMALL GAMMA}"
VOID = {"meta", "link", "wbr", "br", "img"}


class Page(HTMLParser):
    """What an HTML page has: ids, links, addresses, and whether its elements are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self._open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("href", "src"):
                self.links.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag


@pytest.fixture(scope="module", params=["gallery", "wrecker_boom", "problem_3_5_6"])
def derivation(request: pytest.FixtureRequest, gallery: Any, example_named: Any) -> Any:
    name = request.param
    return kc.derivation(gallery if name == "gallery" else example_named(name).model)


@pytest.mark.slow
def test_that_the_page_is_one_file_and_its_links_lead_somewhere(derivation: Any) -> None:
    text = derivation.to_html()
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    inner = {link[1:] for link in page.links if link.startswith("#")}
    assert inner
    assert inner <= set(page.ids)
    assert [link for link in page.links if not link.startswith("#")] == ["data:,"]
    assert "script" not in page.tags
    assert not re.search(r"https?:|url\((?!\"data:)|@import", text)


def test_that_the_page_of_the_wrecker_boom_is_small(example_named: Any) -> None:
    text = kc.derivation(example_named("wrecker_boom").model).to_html()
    assert len(text.encode()) < MOST_BYTES


@pytest.mark.slow
def test_that_the_page_of_a_long_chain_grows_with_its_length() -> None:
    sizes = []
    for length in (12, 24):
        m = kc.Mechanism("chain")
        links = [m.body(f"link{k}", guess=(k + 0.5, 0, 0)) for k in range(length)]
        for k, (i, j) in enumerate(zip([m.ground, *links], links, strict=False)):
            m.add(kc.Revolute(f"A{k}", i, (0.5 if k else 0, 0), j, (-0.5, 0)))
            m.add(kc.RelativeAngle(f"motor{k}", i, j, kc.t / (k + 1)))
        sizes.append(len(kc.derivation(m).to_html()))
    assert sizes[1] < 2.5 * sizes[0]


def test_that_every_cell_of_the_jacobian_leads_to_its_line(example_named: Any) -> None:
    example = example_named("four_bar")
    text = kc.derivation(example.model).to_html()
    jacobian = text[text.index('<section id="jacobian">') :]
    for row, column in example.module.PATTERN:
        anchor = f"Phi_q-{row}-{column}"
        assert f'href="#{anchor}"' in jacobian
        line = text[text.index(f'id="{anchor}"') :]
        assert re.match(r"[^\n]*</div>\s*<(details|p) class=\"src\"", line)


def test_that_pages_do_not_depend_on_the_run(example_named: Any) -> None:
    model = example_named("slider_crank").model
    first, second = kc.derivation(model), kc.derivation(model)
    assert first.to_html() == second.to_html()
    assert first.to_notebook() == second.to_notebook()


def test_that_markdown_keeps_formulas_from_being_read_as_markdown(derivation: Any) -> None:
    text = derivation.to_markdown()
    assert text.count("```") % 2 == 0
    outside = re.sub(r"```.*?```|\$`.*?`\$|`[^`\n]*`", "", text, flags=re.DOTALL)
    outside = re.sub(r"<a id=\"[^\"]*\"></a>|\]\(#[^)]*\)", "", outside)
    assert "_" not in outside
    assert not re.search(r"(?<!\\)\$", outside)
    anchors = re.findall(r'<a id="([^"]*)">', text)
    assert set(re.findall(r"\]\(#([^)]*)\)", text)) <= set(anchors)


def test_that_rows_of_a_markdown_table_have_equally_many_cells(derivation: Any) -> None:
    table: list[int] = []
    for line in derivation.to_markdown().splitlines():
        if line.startswith("|"):
            table.append(line.count(" | "))
            assert table[0] == table[-1], line
        else:
            table = []


def test_that_braces_balance_in_latex(derivation: Any) -> None:
    text = re.sub(r"\\[{}%]", "", derivation.to_latex())
    assert text.count("{") == text.count("}")
    for name in ("bmatrix", "tabular", "document"):
        assert text.count(f"\\begin{{{name}}}") == text.count(f"\\end{{{name}}}")
    assert text.isascii()


def test_that_a_notebook_is_a_notebook(derivation: Any) -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    notebook = nbformat.reads(derivation.to_notebook(), as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            ast.parse(cell.source)


def test_that_a_notebook_computes_the_numbers_of_the_page(example_named: Any) -> None:
    derivation = kc.derivation(example_named("four_bar").model, 0.3)
    names: dict[str, Any] = {}
    for cell in json.loads(derivation.to_notebook())["cells"]:
        if cell["cell_type"] == "code":
            exec(cell["source"].replace("print(", "("), names)
    solution = kc.solve(example_named("four_bar").module, [0.3])
    np.testing.assert_allclose(names["q"], solution.q[0], atol=1e-9)
    np.testing.assert_allclose(names["q_dot"], solution.q_dot[0], atol=1e-9)
    assert names["correction"].shape == (9,)


@pytest.mark.slow
def test_that_slides_have_one_constraint_each(gallery: Any) -> None:
    text = kc.derivation(gallery).to_slides()
    page = Page(text)
    constraints = [f"constraint-{item.name}" for item in gallery.system().constraints]
    assert [item for item in page.ids if not item.startswith("Phi")] == ["mechanism", *constraints]
    slide = text[text.index('id="constraint-slide"') : text.index('id="constraint-rt"')]
    assert slide.count('<svg class="figure"') == 1
    assert slide.count(f"&#{ord(BOLD_GAMMA)};") == 2
    assert "<table>" not in slide


@pytest.mark.parametrize("ending", ["html", "slides.html", "tex", "md", "ipynb"])
def test_that_the_ending_names_the_format(ending: str, example_named: Any, tmp_path: Path) -> None:
    derivation = kc.derivation(example_named("simple_pendulum").model)
    path = derivation.write(tmp_path / f"page.{ending}")
    beginning = {"tex": r"\documentclass", "md": "# ", "ipynb": "{"}
    assert path.read_text(encoding="utf-8").startswith(beginning.get(ending, "<!DOCTYPE html>"))


def test_that_another_ending_is_refused(example_named: Any, tmp_path: Path) -> None:
    derivation = kc.derivation(example_named("simple_pendulum").model)
    with pytest.raises(InputError, match=r"page\.pdf.*\.slides\.html, \.html, \.tex, \.md"):
        derivation.write(tmp_path / "page.pdf")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_that_pdflatex_sets_the_document(derivation: Any, tmp_path: Path) -> None:
    derivation.write(tmp_path / "page.tex")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "page.tex"]
    for _ in range(2):
        done = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, errors="replace", check=False
        )
        assert done.returncode == 0, done.stdout[-2000:]
    too_wide = re.findall(r"Overfull \\hbox \((\d+)\.\d*pt", done.stdout)
    assert max(map(int, too_wide), default=0) < 30  # of a margin of 62 points
    assert "Missing character" not in done.stdout
    assert "undefined references" not in done.stdout


@pytest.mark.slow
def test_that_the_notebook_runs(example_named: Any, tmp_path: Path) -> None:
    pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    kc.derivation(example_named("four_bar").model).write(tmp_path / "page.ipynb")
    program = (
        "import nbformat, nbclient\n"
        "notebook = nbformat.read('page.ipynb', as_version=4)\n"
        "nbclient.NotebookClient(notebook, timeout=120, kernel_name='python3').execute()\n"
        "print(sum('outputs' in cell and bool(cell.outputs) for cell in notebook.cells))\n"
    )
    folders = (
        "HOME",
        "JUPYTER_RUNTIME_DIR",
        "JUPYTER_CONFIG_DIR",
        "JUPYTER_DATA_DIR",
        "IPYTHONDIR",
    )
    environment = {**os.environ, **dict.fromkeys(folders, str(tmp_path))}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) > 5
