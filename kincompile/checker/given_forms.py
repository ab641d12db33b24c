"""The forms in which a hand-in may be: by the coordinates, and in space by small rotations too."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from kincompile.checker.conventions import GLOBAL
from kincompile.checker.layouts import expected_widths, usual_layout
from kincompile.checker.reference import MATRICES, OF_LOADS, Reference, Subject
from kincompile.checker.turned import TurnedReference
from kincompile.errors import InputError
from kincompile.model.small_rotations import BY_OMEGA, BY_P, is_norm
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.checker.conventions import Stated
    from kincompile.checker.reference import ConstraintBlock
    from kincompile.checker.states import States


@dataclass(frozen=True, slots=True)
class GivenForm:
    """A system, or one constraint of it, in one form."""

    reference: Reference
    block: ConstraintBlock | None

    def subject(self, states: States) -> Subject:
        """Return what is compared at some states."""
        return Subject(self.reference, self.block, states)

    def shape_problems(self, name: str, rows: int, columns: int) -> list[str]:
        """Return what is wrong with the shape of a quantity."""
        reference, block, found = self.reference, self.block, []
        names = reference.equations if block is None else block.constraint.equation_names
        names = reference.base.coordinates if name in OF_LOADS else names
        if rows != len(names):
            expected = f"{len(names)}, one for each of: {listed(names, 60)}"
            found.append(f"{name} has {rows} rows; expected {expected}")
        if name == "M" and columns != len(names):
            found.append(f"M has {columns} columns; expected {len(names)}, as many as rows")
        if name == "Phi_q" and usual_layout(reference, block, columns) is None:
            widths = expected_widths(reference, block)
            found.append(f"Phi_q has {columns} columns; expected {widths}")
        if name not in MATRICES and columns != 1:
            found.append(f"{name} has {columns} columns; it is a vector: expected one")
        return found


@dataclass(frozen=True)
class Forms:
    """The forms that a hand-in may have, the system's own first."""

    reference: Reference
    stated: Stated
    constraint: str | None  # name of the one constraint that is checked; all where None

    @cached_property
    def all(self) -> list[GivenForm]:
        """The forms, one alone where it is stated.

        Raises
        ------
        InputError
            If there is no such constraint, or a form is stated that the mechanism does not have.
        """
        name, found = self.constraint, self._references()
        if self.stated.form not in ("", *found):
            raise InputError(
                f"the convention form = {self.stated.form!r} is one of mechanisms in space, not "
                f"of their norm rows; here it is: {listed(found)}"
            )
        return [
            GivenForm(reference, None if name is None else reference.block(name))
            for form, reference in found.items()
            if self.stated.form in ("", form)
        ]

    def _references(self) -> dict[str, Reference]:
        base = self.reference
        found = {BY_P: base}
        block = None if self.constraint is None else base.block(self.constraint)
        if base.spins and (block is None or not is_norm(block.constraint)):
            for form, is_global in ((BY_OMEGA, False), (GLOBAL, True)):
                if form not in base.kept:  # with the system, for the next hand-in
                    base.kept[form] = TurnedReference(base, is_global)
                found[form] = base.kept[form]
        return found

    def shape_problems(self, name: str, rows: int, columns: int) -> list[str]:
        """Return what is wrong with the shape of a quantity in every form."""
        problems = [form.shape_problems(name, rows, columns) for form in self.all]
        if not all(problems):
            return []
        turned = [f"in the r-omega form: {item}" for own in problems[1:2] for item in own]
        return [*problems[0], *turned]

    def fitting(self, shapes: Mapping[str, tuple[int, int]]) -> list[GivenForm]:
        """Return the forms that have the shapes of all quantities.

        Raises
        ------
        InputError
            If there is none, though each quantity has one.
        """
        found = [
            form
            for form in self.all
            if not any(form.shape_problems(name, *shape) for name, shape in shapes.items())
        ]
        if not found:
            sizes = [f"{name} is {rows} x {columns}" for name, (rows, columns) in shapes.items()]
            raise InputError(
                f"{listed(sizes)}: that is two forms; Phi_q has seven columns a body, and every "
                "quantity has norm rows, or Phi_q has six, and none has them"
            )
        return found
