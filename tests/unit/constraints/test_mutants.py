"""The comparison with the oracle can fail: one wrong sign or term in the text is found out."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from kincompile.runtime.load import from_source

BODY = re.compile(r"^def _kinematics\(.*?(?=\n\n\n)", re.MULTILINE | re.DOTALL)
WRONG = {" + ": (" - ", " + 0 * "), " - ": (" + ", " - 0 * "), "**2": ("",), "-": ("",)}
"""What goes in place of an operator: another sign, nothing of the next factor, no square."""
OPERATOR = re.compile(r" [+-] |\*\*2|(?<=[ (])-(?=[a-z(])")


def mutants(source: str) -> Iterator[tuple[str, str]]:
    """Yield the fused function of an emitted text with one operator wrong, and the line."""
    body = BODY.search(source)
    assert body is not None
    start = 0
    for line in body[0].splitlines(keepends=True):
        code = line.partition("#")[0]
        for found in OPERATOR.finditer(code):
            for wrong in WRONG[found[0]]:
                text = code[: found.start()] + wrong + code[found.end() :]
                yield text.strip(), body[0][:start] + text + body[0][start + len(code) :]
        start += len(line)


def test_that_every_wrong_sign_and_missing_term_is_found(
    generic_case: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, unnoticed, count = generic_case.module, [], 0
    for line, text in mutants(generic_case.source):
        namespace = dict(vars(module))
        exec(text, namespace)
        monkeypatch.setattr(module, "_kinematics", namespace["_kinematics"])
        if generic_case.deviation(module.kinematics) < 1e-6:
            unnoticed.append(line)
        count += 1
    assert unnoticed == []
    assert count > 0


def test_that_a_missing_centripetal_term_is_found(case_of: Callable[..., Any]) -> None:
    case = case_of("Revolute")
    kernel = BODY.search(case.source)
    assert kernel is not None
    wrong = kernel[0].replace("phi_i_dot**2", "0.0")
    assert wrong != kernel[0]
    broken = case.source.replace(kernel[0], wrong)
    assert case.deviation(from_source(broken, "mutant").kinematics) > 1e-3


def test_that_a_changed_sign_in_the_jacobian_is_found(case_of: Callable[..., Any]) -> None:
    case = case_of("Gear")
    lines = [line for line in case.source.splitlines() if line.endswith("# k by phi_i")]
    assert lines
    broken = case.source
    for line in lines:
        broken = broken.replace(line, re.sub(r"^( +)(.*),  #", r"\1-(\2),  #", line))
    module = from_source(broken, "mutant")

    def kinematics(q: Any, q_dot: Any, t: Any, p: Any) -> tuple[Any, ...]:
        return *module.position(q, t, p), module.nu(q, t, p), module.gamma(q, q_dot, t, p)

    assert case.deviation(kinematics) > 1e-3


def test_that_the_text_as_emitted_passes(generic_case: Any) -> None:
    module = from_source(generic_case.source, "untouched")
    assert generic_case.deviation(module.kinematics) < 1e-12
