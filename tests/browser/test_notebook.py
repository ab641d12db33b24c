"""An executed notebook, shown by Chromium: the drawing, the player in its frame, the plots."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FOLDERS = (
    "HOME", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "IPYTHONDIR",
    "MPLCONFIGDIR",
)  # fmt: skip

CELLS = (
    f"import sys; sys.path.insert(0, {str(EXAMPLES)!r})\n"
    "import kincompile as kc\nimport numpy as np\nfrom four_bar import mechanism as m\nm",
    "sol = kc.solve(kc.compile(m), np.linspace(0, 4, 101))\nsol",
    "sol.plot('rocker.phi', 'rocker.phi_dot');",
    "kc.plot_mechanism(m, sol.q[20], names=True);",
    "kc.plot_sparsity(m);",
)

EXECUTE = """
import json, sys
import nbclient, nbformat
from nbformat.v4 import new_code_cell, new_notebook
cells = [new_code_cell(source) for source in json.load(sys.stdin)]
notebook = new_notebook(cells=cells)
nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
print(json.dumps([[item.data for item in cell.outputs if "data" in item] for cell in cells]))
"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
]


@pytest.fixture(scope="module")
def outputs(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return what the cells show: a list for each, of texts by their MIME type."""
    for package in ("nbclient", "ipykernel", "matplotlib"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    folder = tmp_path_factory.mktemp("notebook")
    done = subprocess.run(
        [sys.executable, "-c", EXECUTE],
        input=json.dumps(CELLS),
        env={**os.environ, **dict.fromkeys(FOLDERS, str(folder))},
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def page(outputs: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Open the outputs one below the other, as a notebook shows them."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    shown = [
        data.get("text/html") or f'<img src="data:image/png;base64,{data["image/png"]}">'
        for cell in outputs
        for data in cell
    ]
    path = tmp_path_factory.mktemp("page") / "notebook.html"
    path.write_text("<!DOCTYPE html>" + "".join(f"<div>{html}</div>" for html in shown), "utf-8")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        opened = browser.new_page(viewport={"width": 1000, "height": 2800})
        opened.said, opened.asked = [], []
        opened.on("console", lambda message: opened.said.append(message.text))
        opened.on("pageerror", lambda error: opened.said.append(str(error)))
        opened.on("request", lambda request: opened.asked.append(request.url))
        opened.goto(path.as_uri())
        opened.wait_for_load_state("networkidle")
        yield opened
        browser.close()


def test_that_every_cell_shows_something(outputs: Any) -> None:
    assert [len(cell) for cell in outputs] == [1] * len(CELLS)
    assert all("image/png" in data for cell in outputs[2:] for data in cell)


def test_that_images_are_there(page: Any) -> None:
    widths = page.evaluate("[...document.images].map(image => image.naturalWidth)")
    assert len(widths) == 4
    assert min(widths) > 300


def test_that_the_player_plays_in_its_frame(page: Any) -> None:
    frame = page.frame_locator("iframe")
    assert frame.locator("h1").inner_text() == "four_bar"
    before = frame.locator("#time").input_value()
    frame.locator("#play").click()
    page.wait_for_timeout(500)
    assert float(frame.locator("#time").input_value()) > float(before)


def test_that_nothing_is_said_or_asked_for(page: Any) -> None:
    assert page.said == []
    assert [url for url in page.asked if not url.startswith(("data:", "about:"))] == [page.url]
