"""`kc.derivation`: how Phi_q, nu and gamma of a mechanism follow from Phi, step by step.

model     -> system()     ConstraintSystem  checked
system    -> evaluation   Evaluation        the emitted module at a state, for the numbers
each type -> derive       RowBlock          the very blocks that are expanded into emitted code,
                                            with the rules that fired while they were derived
blocks    -> sections     Derivation        the page as data
page      -> to_...       text              HTML, LaTeX, Markdown, a notebook
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.derivations.assembled import assembled_section, unknowns_section
from kincompile.derivations.elimination import evaluation_of
from kincompile.derivations.equation_section import equation_section
from kincompile.derivations.evaluation import Evaluation, evaluation
from kincompile.derivations.figures import Figures
from kincompile.derivations.joint_section import joint_section
from kincompile.derivations.joint_terms import abbreviations
from kincompile.derivations.load_section import load_abbreviations, loads_section
from kincompile.derivations.slides import slides_of
from kincompile.derivations.transmission_section import transmission_section
from kincompile.derivations.turned_section import R_OMEGA, turned_section
from kincompile.errors import InputError
from kincompile.further import held_system
from kincompile.html import framed_html
from kincompile.model.mechanism import system_of
from kincompile.model.resolve import Joint
from kincompile.model.small_rotations import BY_OMEGA, BY_P, is_norm, turned_joint
from kincompile.names import listed, suggestion
from kincompile.report.document import LEVELS, Chapter, Manuscript, of_levels
from kincompile.report.to_html import as_html
from kincompile.report.to_latex import as_tex
from kincompile.report.to_markdown import as_markdown
from kincompile.report.to_notebook import as_notebook
from kincompile.tables import counted
from kincompile.transmissions.loop import loop_of
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path

    from kincompile.calculus.expressions import Expression
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.report.formulas import Glyph
    from kincompile.transmissions.loop import Loop


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Derivation(Manuscript):
    """The derivation of a mechanism's equations, to be printed.

    The attributes are those of `Manuscript`: the name, and what the page says as data.
    """

    def to_html(self) -> str:
        """Return one self-contained page: MathML, no script, no network."""
        return as_html(self)

    def to_slides(self) -> str:
        """Return a page of slides, one for each constraint, for a screen or to be printed."""
        return as_html(slides_of(self), kind="slides")

    def to_latex(self) -> str:
        """Return a LaTeX document, for pdflatex."""
        return as_tex(self)

    def to_markdown(self) -> str:
        """Return Markdown with formulas as GitHub renders them."""
        return as_markdown(self)

    def to_notebook(self) -> str:
        """Return a Jupyter notebook, the text of an .ipynb file; it computes the numbers again."""
        return as_notebook(self)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the derivation in the format that the file's ending names.

        Parameters
        ----------
        path : path-like
            Ends with .html, .slides.html (a slide for each constraint), .tex, .md or .ipynb.

        Raises
        ------
        InputError
            If the ending is another, or the file cannot be written.
        """
        return write_atomically(path, format_of(path)(self))

    def __repr__(self) -> str:
        """Return name and sizes."""
        return f"<Derivation of {self.name!r}: {self.summary}>"

    def _repr_html_(self) -> str:
        return framed_html(self.to_html(), f"Derivation of {self.name}", "40em")


FORMATS: Mapping[str, Callable[[Derivation], str]] = {
    ".slides.html": Derivation.to_slides,
    ".html": Derivation.to_html,
    ".tex": Derivation.to_latex,
    ".md": Derivation.to_markdown,
    ".ipynb": Derivation.to_notebook,
}
"""What prints a derivation, by the ending of the file it goes to."""


def format_of(path: str | os.PathLike[str]) -> Callable[[Derivation], str]:
    """Return what prints a derivation in the format of a file.

    Raises
    ------
    InputError
        If the file's ending names none.
    """
    for ending, printed in FORMATS.items():
        if str(path).endswith(ending):
            return printed
    raise InputError(f"{path}: a derivation is written to a file that ends with {listed(FORMATS)}")


def derivation(
    model: Mechanism | ConstraintSystem,
    state: Mapping[str, float] | float | None = None,
    *,
    constraint: str | None = None,
    levels: Iterable[str] = LEVELS,
    form: str = BY_P,
    transmission: tuple[Sequence[str], Sequence[str]] | None = None,
) -> Derivation:
    """Show how Phi_q, nu and gamma of a mechanism follow from Phi, step by step.

    Parameters
    ----------
    model
        A mechanism or a system of free equations; it may lack equations.
    state
        Where the numbers are taken: a time, at which the mechanism is assembled, or values by name
        (coordinates, rates, parameters and ``t``), taken as they are. By default a time at which
        nothing is special, so that a wrong sign shows; the guess where nothing assembles.
    constraint
        Name of the constraint to show; all, and the assembled system, by default.
    levels
        Which of the levels are shown: in vectors, in sines and cosines, in numbers.
    form
        In space by what Phi_q has derivatives, and gamma the second rates: ``"r-p"`` (ME751) or
        ``"r-omega"``, r and small rotations pi' about the axes of the bodies (Haug).
    transmission
        Names of the inputs and of the outputs, as for `transmission`: then the page shows how the
        Jacobian of the outputs by the inputs follows from Phi_q. The state is that of inputs and
        parameters by name, of which those left out have their first values.

    Returns
    -------
    Derivation
        ``.to_html()``, ``.to_latex()``, ``.to_markdown()``, ``.to_notebook()``, ``.write(path)``.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If the state has unknown names, the formulas have no finite values there, or there is no
        such constraint or level.
    """
    if transmission is not None:
        if constraint is not None or tuple(levels) != LEVELS or form != BY_P:
            raise InputError(
                "the derivation of a transmission is one: leave out constraint, levels and form."
            )
        return _of_transmission(loop_of(model, *transmission), state)
    system = held_system(system_of(model))
    _require_known(system, constraint, shown := tuple(levels))
    _require_form(system, constraint, form)
    chosen = evaluation(system, state)
    figures = Figures(chosen)
    names, sections = constraint_chapters(figures, constraint, form)
    intro = () if form == BY_P else (R_OMEGA,)
    constraints = Chapter("constraints", ("The constraints, one by one",), intro, sections)
    chapters = [unknowns_section(figures), constraints]
    if constraint is None:
        chapters.append(assembled_section(chosen))
        if system.loads:
            chapters.append(loads_section(chosen))
    return Derivation(
        system.name,
        _summary(chosen),
        tuple(of_levels(item, shown) for item in chapters),
        names,
        chosen.source,
        _state_code(chosen),
    )


def _of_transmission(loop: Loop, state: Mapping[str, float] | float | None) -> Derivation:
    """Return how the Jacobian of a loop follows from its equations."""
    chosen = evaluation_of(loop, state)
    chapters = unknowns_section(Figures(chosen)), transmission_section(chosen, loop)
    summary = f"{listed(loop.inputs)} to {listed(loop.outputs)}; {_summary(chosen)}"
    return Derivation(loop.system.name, summary, chapters, {}, chosen.source, _state_code(chosen))


def constraint_chapters(
    figures: Figures, constraint: str | None = None, form: str = BY_P
) -> tuple[dict[Expression, Glyph], tuple[Chapter, ...]]:
    """Return the nine steps of each constraint, or of one, and the abbreviations in them.

    In the r-omega form there are no norm rows; free equations are derived by the coordinates.
    """
    chosen = figures.evaluation
    constraints = chosen.system.constraints
    section = joint_section if form == BY_P else turned_section
    sections = tuple(
        section(figures, item, rows)
        if isinstance(item, Joint)
        else equation_section(chosen, item, rows)
        for item, rows in zip(constraints, chosen.code.constraints, strict=True)
        if constraint in (None, item.name) and (form == BY_P or not is_norm(item))
    )
    names: dict[Expression, Glyph] = {}
    for item in constraints:
        if isinstance(item, Joint):
            names |= abbreviations((item if form == BY_P else turned_joint(item)).template)
    for load in chosen.system.loads:
        names |= load_abbreviations(load.template)
    return names, sections


def _require_form(system: ConstraintSystem, constraint: str | None, form: str) -> None:
    if form not in (BY_P, BY_OMEGA):
        raise InputError(f"there is no form {form!r}; forms are: {listed((BY_P, BY_OMEGA))}")
    if form == BY_P:
        return
    if not any(body.on_request for body in system.bodies):
        raise InputError(
            f"{system.name} is no mechanism of bodies in space: it has no {BY_OMEGA} form"
        )
    if any(item.name == constraint and is_norm(item) for item in system.constraints):
        raise InputError(f"{constraint} is a norm row, which the {BY_OMEGA} form does not have")


def _require_known(
    system: ConstraintSystem, constraint: str | None, levels: tuple[str, ...]
) -> None:
    names = [item.name for item in system.constraints]
    if constraint is not None and constraint not in names:
        raise InputError(
            f"{system.name} has no constraint {constraint!r}{suggestion(constraint, names)}; "
            f"constraints are: {listed(names)}"
        )
    unknown = [level for level in levels if level not in LEVELS]
    if unknown or not levels:
        raise InputError(
            f"there is no level {', '.join(unknown) or 'left'}; levels are: {listed(LEVELS)}"
        )


def _summary(chosen: Evaluation) -> str:
    system = chosen.system
    sizes = ", ".join(
        (
            counted(len(system.coordinates), "coordinate"),
            counted(len(system.equations), "equation"),
            counted(len(system.parameters), "parameter"),
        )
    )
    return f"{sizes}; numbers at {chosen.origin}"


def _state_code(chosen: Evaluation) -> str:
    """Return the state as Python code, exact to the last digit."""
    lines = [f"t = {chosen.t!r}"]
    for name, values in (("q", chosen.q), ("q_dot", chosen.q_dot), ("p", chosen.p)):
        lines.append(f"{name} = np.array({(values + 0.0).tolist()})")
    return "\n".join(lines)
