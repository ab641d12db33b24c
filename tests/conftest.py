"""What every test shares: fixed seeds, the option that rewrites the goldens, and the examples."""

import gc
import os
import runpy
import shutil
import subprocess
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest

import kincompile as kc

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))

# The same examples on every run and every machine, nothing written into the checkout, and no
# deadline: a slow machine is not a wrong result.
hypothesis.settings.register_profile(
    "kincompile", derandomize=True, database=None, deadline=None, print_blob=False
)
hypothesis.settings.load_profile("kincompile")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--update-goldens`, which the tests of the goldens obey; a rewrite fails the run."""
    parser.addoption(
        "--update-goldens",
        action="store_true",
        help="rewrite generated/ from the examples, remove strays, list both and fail the run",
    )


TOGETHER = ("tests/targets/", "tests/unit/files/test_hostile.py")
"""Tests of one process, slow ones too: what each target says of all mechanisms, and what becomes of
all hostile files, takes a minute and more to find out."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Return what gives tests to processes with `--dist=loadfile`, as the Makefile asks."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadScopeScheduling  # several processes are optional

    is_quick = config.option.markexpr.startswith("not slow")

    class Together(LoadScopeScheduling):  # type: ignore[misc]
        """One process has the tests of a file, which share what is made; of slow ones of a test."""

        def _split_scope(self, nodeid: str) -> str:
            path, _, _ = nodeid.partition("::")
            place = next((place for place in TOGETHER if path.startswith(place)), path)
            return place if is_quick or place in TOGETHER else nodeid.partition("[")[0]

    return Together(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep every n-th case of `every(n)` quick; the others are slow."""
    cases = Counter[str]()
    for item in items:
        mark, function = item.get_closest_marker("every"), item.nodeid.partition("[")[0]
        if mark and not item.get_closest_marker("slow"):
            if cases[function] % mark.args[0]:
                item.add_marker(pytest.mark.slow)
            cases[function] += 1


def pytest_collection_finish() -> None:
    """Let the collector of garbage look less often, and not through what is there to stay."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Let a skipped test fail in CI, which installs everything that a test may ask for."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("CI"):
        report.outcome = "failed"
        report.longrepr = f"CI skips no test, and this one says: {report.longrepr}"
    return report


@pytest.fixture
def start_process() -> Iterator[Callable[..., "subprocess.Popen[str]"]]:
    """Return a function that starts a process, which ends with the test whatever happens."""
    started: list[subprocess.Popen[str]] = []

    def start(command: list[str]) -> "subprocess.Popen[str]":
        pipe = subprocess.PIPE
        started.append(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


@dataclass(frozen=True)
class Example:
    """An example, emitted, compiled and solved when a test first asks for it."""

    path: Path
    model: Any

    def files(self, target: str) -> Any:
        """Text by file name, as a target emits it."""
        return kc.emit(self.model, target).files

    @cached_property
    def source(self) -> Any:
        """The emitted NumPy module as text."""
        return kc.emit(self.model).source

    @cached_property
    def module(self) -> Any:
        """The emitted NumPy module."""
        return kc.compile(self.model)

    @cached_property
    def native(self) -> Any:
        """The module of the C target; a test that takes it takes `quick_compiler` too."""
        return kc.compile(self.model, target="c")

    @cached_property
    def solution(self) -> Any:
        """The motion over the example's own time grid."""
        return kc.solve(self.module, np.linspace(0, self.model.end, self.model.points))


@cache
def load_example(path: Path) -> Example:
    """Run an example's file, once a session, and take its model."""
    names = runpy.run_path(str(path))
    return Example(path, names["mechanism"] if "mechanism" in names else names["system"])


@pytest.fixture(scope="session", autouse=True)
def compiler_of_session(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[str | None]:
    """Let the C target build without optimization, in a cache that all processes and runs share.

    What the optimization does is left to the tests that ask for the machine's own compiler, whose
    path is the fixture's value; None where there is none. The cache names a library by its source
    and its flags, the compiler's path among them: in pytest's own cache that is always the same.
    """
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        yield None
        return
    kept = getattr(request.config, "cache", None)
    folder = kept.mkdir("native") if kept else tmp_path_factory.mktemp("native")
    quick = folder / "quick-cc"
    written = folder / f"quick-cc-{os.getpid()}"
    written.write_text(
        '#!/bin/sh\nfor word do shift\ncase "$word" in -O[123]) word=-O0;; esac\n'
        '[ "$word" = -D_WHOLE_REGISTERS ] || set -- "$@" "$word"; done\n'
        f'exec {compiler} "$@"\n'
    )
    written.chmod(0o755)
    written.replace(quick)
    before = {name: os.environ.get(name) for name in ("CC", "XDG_CACHE_HOME")}
    os.environ.update(CC=str(quick), XDG_CACHE_HOME=str(folder / "cache"))
    yield compiler
    for name, value in before.items():
        os.environ.pop(name)
        if value is not None:
            os.environ[name] = value


@pytest.fixture(scope="session")
def quick_compiler(compiler_of_session: str | None) -> str:
    """Return the machine's own compiler; a test that needs one asks for it."""
    if compiler_of_session is None:
        pytest.skip("there is no C compiler")
    return compiler_of_session


MORE = {"double_wishbone", "jansen", "klann", "shaper", "swing_and_dwell"}
"""Examples that only the exhaustive run has: their joints and drivers are those of the others."""


def marked(path: Path) -> object:
    """Return an example as a parameter."""
    marks = [pytest.mark.slow] if path.stem in MORE else []
    return pytest.param(path, marks=marks, id=path.stem)


@pytest.fixture(scope="session", params=map(marked, EXAMPLES))
def example(request: pytest.FixtureRequest) -> Example:
    """Each of the examples in turn."""
    return load_example(request.param)


@pytest.fixture(scope="session")
def example_named() -> Callable[[str], Example]:
    """Return the function that gives an example by name."""
    return lambda name: load_example(next(EXAMPLES[0].parent.rglob(f"{name}.py")))
