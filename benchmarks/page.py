"""The page while a slider is pulled: solved and drawn again in headless Chromium.

`python -m benchmarks.page` prints its tables in a minute; it needs Chromium and playwright. The
peer is a plain loop of JavaScript in the same page, as machines differ: a million sines and as many
products. What a frame takes is from the event of the slider to the end of the drawing; what the
browser then does to put it on the screen is its own.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import Timing

if TYPE_CHECKING:
    from collections.abc import Iterator

PAGES = {"four_bar": (201, 16.0), "wrecker_boom": (161, 33.0), "jansen": (361, 33.0)}
"""Points of the motion, and how long a frame may take [ms]."""

FRAMES = 200

PULL = """async frames => {
  const solving = [], redrawing = [], loops = [];
  const timed = (owner, name, list) => {
    const action = owner[name];
    owner[name] = (...given) => {
      const begin = performance.now(), result = action.apply(owner, given);
      list.push(performance.now() - begin);
      return result;
    };
  };
  timed(live, 'solved', solving);
  timed(live, 'solve', redrawing);
  const slider = document.getElementById('slider-0'), given = Number(slider.value);
  for (let k = 0; k < frames; k += 1) {
    slider.value = given * (1 + 0.04 * Math.sin(k / 7));
    slider.dispatchEvent(new Event('input'));
    await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    const begin = performance.now();
    for (let i = 0, sum = 0; i < 1e6; i += 1) sum += Math.sin(i) * 0.5;
    loops.push(performance.now() - begin);
  }
  return [solving, redrawing, loops].map(times => times.slice(frames / 4));
}"""


EDITOR = "editor, 15 bodies"
LIMITS = PAGES | {EDITOR: (201, 16.0)}

DRAW = """async frames => {
  const solving = [], redrawing = [], loops = [], place = [0.1, 0];
  const run = editing.run.bind(editing);
  editing.run = () => {
    const begin = performance.now();
    run();
    solving.push(performance.now() - begin);
  };
  editor.hold('B0');
  for (let k = 0; k < frames; k += 1) {
    const begin = performance.now();
    editor.bring('B0', [place[0], place[1] + 0.01 * Math.sin(k / 7)]);
    redrawing.push(performance.now() - begin);
    await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    const from = performance.now();
    for (let i = 0, sum = 0; i < 1e6; i += 1) sum += Math.sin(i) * 0.5;
    loops.push(performance.now() - from);
  }
  return [solving, redrawing, loops].map(times => times.slice(frames / 4));
}"""
"""As PULL, of a joint of the editor."""


def chain(dyads: int) -> str:
    """Return a file with a crank and dyads, each of which moves the next one."""
    ground, joints = ["A0 = [0, 0]"], ["B0 = [0.1, 0]"]
    parts = ['{ link = "crank", joints = "A0 B0" }']
    for k in range(1, dyads + 1):
        ground.append(f"A{k} = [{0.6 * k + 0.3:.4g}, -0.1]")
        joints.append(f"B{k} = [{0.6 * k + 0.1:.4g}, {0.5 + 0.02 * k:.4g}]")
        parts.append(f'{{ link = "rod{k}", joints = "B{k - 1} B{k}" }}')
        parts.append(f'{{ link = "arm{k}", joints = "A{k} B{k}" }}')
    parts.append('{ drive = "crank", value = "0 + 2*pi*t" }')
    return (
        'kincompile = 1\nname = "chain"\nanalysis = { end = 1, points = 201 }\n[sketch]\n'
        f"ground = {{ {', '.join(ground)} }}\njoints = {{ {', '.join(joints)} }}\n"
        f"parts = [{', '.join(parts)}]\n"
    )


def main() -> None:
    """Measure and print."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("skipped: playwright is not installed")
        return
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    before = machine.load()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        found = {name: pulled(browser, Path(folder), name) for name in PAGES}
        found[EDITOR] = drawn(browser, Path(folder))
        browser.close()
    heads = ("page", "solve, ms", "solve and draw, ms", "a million sines, ms", "frame / loop")
    print_table("Pulling a slider, median (least)", heads, rows(found))
    print_targets("What was to be reached", reached(found))
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def pulled(browser: Any, folder: Path, name: str) -> tuple[Timing, ...]:
    """Return the times of the solve, of a frame and of the loop, of the page of an example."""
    model = kc.read(Path(__file__).parents[1] / "examples" / f"{name}.toml")
    path = folder / f"{name}.html"
    kc.page(model, t=np.linspace(0, model.system().end, PAGES[name][0])).write(path)
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.goto(path.as_uri())
    found = page.evaluate(PULL, FRAMES)
    page.close()
    return tuple(Timing(tuple(times)) for times in found)


def drawn(browser: Any, folder: Path) -> tuple[Timing, ...]:
    """Return the same times of the editor, in which a joint is pulled."""
    model = folder / "chain.toml"
    model.write_text(chain(7), encoding="utf-8")
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.goto(kc.editor(model).write(folder / "editor.html").as_uri())
    found = page.evaluate(DRAW, FRAMES)
    assert page.evaluate("editing.motion.failed") is None
    page.close()
    return tuple(Timing(tuple(times)) for times in found)


def rows(found: dict[str, tuple[Timing, ...]]) -> Iterator[list[str]]:
    """Give a row per page."""
    for name, times in found.items():
        cells = [f"{timing.median:.3g} ({timing.least:.3g})" for timing in times]
        yield [name, *cells, f"{times[1].median / times[2].median:.2g}"]


def reached(found: dict[str, tuple[Timing, ...]]) -> Iterator[Target]:
    """Compare with the limits."""
    for name, (_, frame, _) in found.items():
        count, limit = LIMITS[name]
        yield Target(f"{name}, {count} points, a frame", frame.median, "at most", limit, "ms")


if __name__ == "__main__":
    main()
