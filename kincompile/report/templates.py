"""Templates: found in the package or a checkout, filled with nothing missing or left over."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import (
    Environment,
    StrictUndefined,
    Template,
    TemplateSyntaxError,
    UndefinedError,
    meta,
)

from kincompile.errors import TemplateError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.resources.abc import Traversable


def template_root() -> Traversable:
    """Return the folder of templates: of the installed package first, then of the checkout."""
    installed = files("kincompile") / "_templates"
    if installed.is_dir():
        return installed
    checkout = Path(__file__).resolve().parents[2] / "templates"
    if checkout.is_dir():
        return checkout
    raise TemplateError(
        "the templates of kincompile are missing from this installation; install it again with pip"
    )


@cache
def _environment() -> Environment:
    return Environment(
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def read(name: str) -> str:
    """Return the text of a file below the folder of templates, as it is: a script, for instance."""
    path = template_root()
    for part in name.split("/"):
        path = path / part
    if not path.is_file():
        raise TemplateError(f"there is no template {name!r}")
    return path.read_text(encoding="utf-8")


@cache
def _template(name: str) -> tuple[Template, frozenset[str]]:
    """Return a template, read and compiled once, and the names of its slots."""
    environment = _environment()
    tree = environment.parse(read(name), name)
    slots = frozenset(meta.find_undeclared_variables(tree))
    code = environment.compile(tree, name)
    return Template.from_code(environment, code, environment.make_globals(None)), slots


def fill(name: str, data: Mapping[str, Any]) -> str:
    """Fill a template, a path below their folder such as ``numpy/module.py.jinja``, with data.

    A `TemplateError` says where a slot has no data, or data no slot.
    """
    try:
        template, slots = _template(name)
        missing, extra = sorted(slots - data.keys()), sorted(data.keys() - slots)
        if missing or extra:
            raise TemplateError(
                f"template {name!r}: slots without data {missing}, data without slots {extra}"
            )
        return template.render(data)
    except (TemplateSyntaxError, UndefinedError) as error:
        raise TemplateError(f"template {name!r}: {error}") from error
