"""Headless Chromium for the tests of pages."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


@pytest.fixture(scope="module")
def open_file() -> Iterator[Callable[..., Any]]:
    """Return a function that opens a file: the page, with what it says and what it asks for."""
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)

        def opened(path: Path, width: int = 1280, scheme: str = "light") -> Any:
            page = browser.new_page(
                viewport={"width": width, "height": 900}, color_scheme=scheme, has_touch=width < 600
            )
            page.said, page.asked = [], []
            page.on("console", lambda message: page.said.append(message.text))
            page.on("pageerror", lambda error: page.said.append(str(error)))
            page.on("request", lambda request: page.asked.append(request.url))
            page.goto(path.as_uri())
            return page

        yield opened
        browser.close()


@pytest.fixture(scope="module")
def open_page(
    open_file: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory, example_named: Any
) -> Callable[..., Any]:
    """Return a function that opens the page of a model, or of an example by name."""
    folder = tmp_path_factory.mktemp("pages")

    def opened(model: Any, width: int = 1280, scheme: str = "light") -> Any:
        model = example_named(model).model if isinstance(model, str) else model
        path = folder / f"{model.name}.html"
        if not path.exists():
            kc.page(model).write(path)
        return open_file(path, width, scheme)

    return opened
