"""The pages of the site that are made: examples, names, benchmarks, and what lies outside docs/.

A Sphinx extension. Before Sphinx looks for pages, they are written into docs/made. When it
reads a page, links that are good in a checkout become links of the site.
"""

from __future__ import annotations

import inspect
import re
from pathlib import PurePosixPath
from posixpath import normpath
from typing import TYPE_CHECKING

import click

import kincompile as kc
from docs.builders import benchmark_plots, lessons, pictures
from docs.builders.places import DOCS, EXAMPLES, ROOT, write
from kincompile.cli import cli
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.names import title_of
from kincompile.space.catalogue import CONSTRAINTS as IN_SPACE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sphinx.application import Sphinx

GENERATED = DOCS / "made"

OUTSIDE = {
    "README.md": "index",
    "CONTRIBUTING.md": "made/contributing",
    "CODE_OF_CONDUCT.md": "made/conduct",
    "SECURITY.md": "made/security",
    "CHANGELOG.md": "made/changelog",
    "benchmarks/README.md": "made/benchmarks",
    "examples/README.md": "made/gallery",
    "examples": "made/gallery",
    "examples/notebooks/README.md": "made/notebooks",
}
"""Pages of the checkout, and those of the site that show them."""

LINK = re.compile(r"(?<=\]\()(?!https?:|#|/)([^)#\s]+)(#[^)\s]*)?(?=\))")

NAMED_BY_FILE = re.compile(r"\[[\w/.]+\.md\]\((?=[^)]*\.md\))")
"""A link whose text is the name of a page's file: the site writes the title of the page."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect with Sphinx."""
    app.connect("builder-inited", lambda _: write_pages())
    app.connect("env-get-outdated", lambda *_: ["guides", "names"])  # they list other pages
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_pages() -> None:
    """Write the pages that are made."""
    pages = {
        "contributing.md": _outside("CONTRIBUTING.md"),
        "conduct.md": _outside("CODE_OF_CONDUCT.md"),
        "security.md": _outside("SECURITY.md"),
        "changelog.md": _outside("CHANGELOG.md"),
        "benchmarks.md": benchmark_plots.with_plots(_outside("benchmarks/README.md")),
        "notebooks.md": _outside("examples/notebooks/README.md"),
        "gallery.md": _gallery(),
    }
    for name in _examples():
        pages[f"examples/{_last(name)}.md"] = _example_page(name)
    for name in documented_names():
        pages[f"api/{name}.md"] = _api_page(name)
    pages["api/spatial.md"] = _spatial_page()
    write(GENERATED, pages)
    write(GENERATED, benchmark_plots.plots())
    _write_motions()


def in_the_site(text: str, folder: str) -> str:
    """Return a text of a folder of the checkout with links of the site."""

    def replaced(match: re.Match[str]) -> str:
        path = normpath(f"{folder}/{match[1]}") if folder else normpath(match[1])
        return f"{_address(path)}{match[2] or ''}"

    return LINK.sub(replaced, NAMED_BY_FILE.sub("[](", text))


def _address(path: str) -> str:
    """Return where the site has a file of the checkout."""
    place = PurePosixPath(path)
    if path in OUTSIDE:
        return f"/{OUTSIDE[path]}.md"
    if place.parts[0] == "docs":
        return f"/{place.relative_to('docs')}"
    folders = (PurePosixPath("examples"), PurePosixPath("examples/space"))
    if place.parent in folders and place.suffix in (".py", ".toml"):
        return f"/made/examples/{place.stem}.md"
    return f"/{normpath('../' + path)}"


def _read(app: Sphinx, name: str, source: list[str]) -> None:
    """Give a page that is read its links, and names and pages what is made."""
    del app
    if not name.startswith("made/"):
        folder = PurePosixPath("docs", name).parent
        source[0] = in_the_site(source[0], str(folder))
    if name == "course/syllabus":
        source[0] = source[0].replace(lessons.SYLLABUS, lessons.syllabus())
    own = f"lesson_{PurePosixPath(name).name}" if name.startswith("course/") else ""
    top = "/".join([".."] * name.count("/")) or "."
    source[0] = lessons.LIVE.sub(lambda match: _live(own or match[1], top), source[0])
    if name == "names":
        source[0] = _with_links(source[0]) + _toctree("made/api/*")
    if name == "command_line":
        source[0] += _options()
    if name == "guides":
        source[0] = source[0].replace("emitted_modules\n```", f"emitted_modules\n{_others()}```")


def _options() -> str:
    """Return what `kincompile COMMAND --help` prints, of every command."""
    context = click.Context(cli, info_name="kincompile", terminal_width=100)
    parts = []
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        printed = command.get_help(click.Context(command, context, name))
        parts.append(f"\n### kincompile {name}\n\n```text\n{printed}\n```\n")
    return "\n## Every option\n" + "".join(parts)


def _others() -> str:
    """Return the pages of docs/ that no page lists: a new one is a guide at first."""
    lists = "\n".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.md"))
    listed = set(re.findall(r"^[\w/]+$", lists, re.MULTILINE))
    return "".join(f"{path.stem}\n" for path in sorted(DOCS.glob("*.md"))
                   if path.stem not in {*listed, "index"})  # fmt: skip


def _toctree(pattern: str) -> str:
    return f"\n```{{toctree}}\n:hidden:\n:glob:\n\n{pattern}\n```\n"


def _outside(path: str) -> str:
    text = (ROOT / path).read_text(encoding="utf-8")
    return in_the_site(text, str(PurePosixPath(path).parent))


# ---- examples ------------------------------------------------------------------------------------


def _examples() -> list[str]:
    """Return the examples, in the order of their tables, as `four_bar` and `space/rssr`."""
    return [name for name, _ in _rows()]


def _rows() -> list[tuple[str, str]]:
    """Return each example, and what it shows."""
    table = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    return re.findall(r"^\| `([\w/]+)\.py` \| (.*?) \|", table, re.MULTILINE)


def _last(name: str) -> str:
    """Return the name of an example without its folder."""
    return PurePosixPath(name).name


def title(name: str) -> str:
    """Return the name of an example as a heading."""
    if name == "rssr":
        return "RSSR"
    return title_of(name)


def _gallery() -> str:
    """Return the page with all examples, each as a card that moves."""
    rows = [(_last(name), what) for name, what in _rows()]
    cards = "".join(
        f":::{{grid-item-card}} {title(name)}\n:link: examples/{name}\n:link-type: doc\n"
        f":img-top: motions/{name}.svg\n:img-alt: {title(name)} in motion\n"
        f"{what[0].upper()}{what[1:]}.\n:::\n\n"
        for name, what in rows
    )
    return (
        "# Gallery\n\nEach example is a page that solves itself: pull a length, drag a body.\n\n"
        f"::::{{grid}} 1 2 3 3\n:gutter: 3\n\n{cards}::::\n{_toctree('examples/*')}"
    )


def _example_page(name: str) -> str:
    """Return the page of an example: what it is, its motion, its source."""
    source = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    first, *rest = inspect.cleandoc(source.split('"""')[1]).split("\n\n")
    return "\n".join([
        f"# {title(_last(name))}", "", first, "", *rest, "",
        _live(_last(name), "../.."), "",
        f"`kincompile view examples/{name}.toml -o {_last(name)}.html` writes this page.", "",
        "::::{tab-set}",
        ":::{tab-item} Python", f"```{{literalinclude}} ../../../examples/{name}.py", "```", ":::",
        ":::{tab-item} TOML", f"```{{literalinclude}} ../../../examples/{name}.toml",
        ":language: toml", "```", ":::",
        "::::", "",
    ])  # fmt: skip


def _live(name: str, top: str) -> str:
    """Return a live page inside another."""
    return (
        f'```{{raw}} html\n<iframe class="live" src="{top}/live/{name}.html" title="{name}, live" '
        f'loading="lazy"></iframe>\n<p><a href="{top}/live/{name}.html">The page alone</a></p>\n```'
    )


def _write_motions() -> None:
    """Write the pictures and the live pages that are older than what they are made from."""
    sources = [*(ROOT / "kincompile").rglob("*.py"), *(ROOT / "templates").rglob("*.*")]
    newest = max(path.stat().st_mtime for path in sources)
    live_folder = GENERATED / "extra" / "live"
    live_folder.mkdir(parents=True, exist_ok=True)
    for name in _examples():
        model = EXAMPLES / f"{name}.toml"
        live = live_folder / f"{_last(name)}.html"
        if live.exists() and live.stat().st_mtime > max(newest, model.stat().st_mtime):
            continue
        last = _last(name)
        shown = pictures.still(last) if name.startswith("space/") else pictures.moving(name)
        write(GENERATED / "motions", {f"{last}.svg": shown})
        kc.page(kc.read_model(model)).write(live)
    kc.page(_wiper()).write(live_folder / "wiper.html")
    kc.editor().write(live_folder / "editor.html")
    for name in lessons.NAMES:
        kc.page(lessons.Lesson(name).model).write(live_folder / f"lesson_{name}.html")


def _wiper() -> kc.Mechanism:
    """Return the mechanism that a tutorial makes."""
    text = (DOCS / "tutorials" / "linkage.md").read_text(encoding="utf-8")
    found: dict[str, kc.Mechanism] = {}
    programs = dict(lessons.MODEL.findall(text))
    exec(programs["wiper.py"], found)
    return found["m"]


# ---- public names --------------------------------------------------------------------------------


def documented_names() -> list[str]:
    """Return the public names that have a page."""
    text = (DOCS / "names.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (.*?) \|", text, re.MULTILINE)
    found = [name for cell in cells for name in re.findall(r"`(\w+)", cell)]
    return [name for name in dict.fromkeys([*found, *CONSTRAINTS]) if name in kc.__all__]


def _with_links(text: str) -> str:
    """Return the table of names, whose first cells are links."""
    known = set(documented_names())

    def linked(match: re.Match[str]) -> str:
        name = match[1]
        return f"[{match[0]}](/made/api/{name}.md)" if name in known else match[0]

    lines = text.splitlines()
    for k, line in enumerate(lines):
        if line.startswith("| `"):
            cell, bar, rest = line[2:].partition(" |")
            lines[k] = "| " + re.sub(r"`(\w+)[^`]*`", linked, cell) + bar + rest
    return "\n".join(lines) + "\n"


def _api_page(name: str) -> str:
    """Return the page of a public name, which autodoc fills."""
    lines = [".. currentmodule:: kincompile", "", *_directive(name, getattr(kc, name))]
    return "\n".join([f"# {name}", "", "```{eval-rst}", *lines, "```", ""])


def _spatial_page() -> str:
    """Return the page of the names in space."""
    classes = "".join(f".. autoclass:: kincompile.spatial.{name}\n\n" for name in IN_SPACE)
    mechanism = ".. autoclass:: kincompile.spatial.Mechanism\n   :members:\n\n"
    head = "# spatial\n\nMechanisms in space: `from kincompile import spatial`."
    return f"{head}\n\n```{{eval-rst}}\n{mechanism}{classes}```\n"


def _directive(name: str, value: object) -> Iterator[str]:
    if inspect.ismodule(value):
        yield from (f".. automodule:: {value.__name__}", "   :members:")
    elif inspect.isclass(value):
        yield f".. autoclass:: {name}"
        if name in CONSTRAINTS:
            yield from ("", "Picture, equation and sense: :doc:`/joints`.")
        elif not issubclass(value, Exception | Warning):
            yield "   :members:"
    elif inspect.isfunction(value):
        yield f".. autofunction:: {name}"
    else:
        yield from (f".. data:: {name}", "", f"   {SYMBOLS[name]}")


SYMBOLS = {
    "t": "Time [s], a SymPy symbol: a constraint whose value depends on it is a driver.",
    "pi": "The number, SymPy's.",
    "deg": "A degree, pi/180: ``90 * kc.deg`` is a right angle.",
    "alpha": "The polar angle [rad] of a cam profile, a SymPy symbol.",
}
"""What the symbols are, which have no docstrings."""
