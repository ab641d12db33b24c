"""docs/space.md: its table is that of the catalogue."""

import re
from pathlib import Path

from kincompile.space.catalogue import CONSTRAINTS

PAGE = (Path(__file__).parents[3] / "docs" / "space.md").read_text(encoding="utf-8")


def test_that_the_table_is_that_of_the_catalogue() -> None:
    table = PAGE[PAGE.index("<!-- catalogue -->") :].split("\n\n")[0]
    found = {}
    for line in table.splitlines()[3:]:
        names, arguments, _, source, _ = line.removeprefix("| ").split(" |")
        for name in re.findall(r"`(\w+)`", names):
            found[name] = arguments.strip(), source.strip()
    expected = {
        name: (", ".join(kind.arguments()), kind.source) for name, kind in CONSTRAINTS.items()
    }
    assert found == expected
