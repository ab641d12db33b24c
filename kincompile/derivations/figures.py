"""The figures of a derivation: the mechanism, and each joint with the vectors of its equation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.linalg import norm

from kincompile.calculus import expressions as ex
from kincompile.calculus.expand import Expansion
from kincompile.derivations.joint_terms import abbreviations, parts
from kincompile.model.arguments import Kind
from kincompile.model.expressions import evaluate
from kincompile.model.resolve import Joint
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.view.drawing import drawing
from kincompile.view.geometry import Geometry
from kincompile.view.marks import GROUND_FRAME, FramePoint
from kincompile.view.picture import Arrow, picture

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.report.picture import Picture
    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, BodyFrame

SHORTEST = 0.4
"""Length of the shortest vector that is drawn, in sizes of marks."""

AXIS, DIRECTION, OF_TRIAD = 5.0, 7.0, 10.0
"""Lengths of the axes of a frame, of directions, and of those in space, in sizes of marks."""

SHORTER = 0.75
"""Part of its length that a direction has where it would lie on another one."""

ALIKE = 1e-2
"""Difference of unit vectors up to which they are seen as one."""


@dataclass(frozen=True, eq=False)
class Figures:
    """Pictures of a mechanism at the state of its numbers."""

    evaluation: Evaluation

    @cached_property
    def _drawn(self) -> Drawing:
        return drawing(self.evaluation.system, self._parameters, self.evaluation.q)

    @property
    def _parameters(self) -> dict[str, float]:
        names = (item.name for item in self.evaluation.system.parameters)
        return dict(zip(names, self.evaluation.p.tolist(), strict=True))

    @cached_property
    def _geometry(self) -> Geometry:
        system, drawn = self.evaluation.system, self._drawn
        joints = [item for item in system.constraints if isinstance(item, Joint)]
        frames = dict(zip(drawn.bodies, drawn.frames, strict=True))
        return Geometry(joints, self._parameters, frames, self.evaluation.q[None])

    def mechanism(self) -> Picture | None:
        """Return the whole mechanism with the axes of its bodies; None without bodies."""
        if not self.evaluation.system.bodies:
            return None
        drawn = self._drawn
        named = zip(drawn.frames, drawn.bodies, strict=True)
        arrows = [arrow for frame, name in named for arrow in self._axes(frame, name)]
        title = f"{drawn.name} at {self.evaluation.origin}"
        return picture(drawn, self.evaluation.q, title, [*self._axes(GROUND_FRAME, ""), *arrows])

    @cached_property
    def _letters(self) -> tuple[str, ...]:
        """The names of the axes of a frame."""
        return tuple("xyz"[: self._drawn.dimension])

    def joint(self, joint: Joint) -> Picture | None:
        """Return a joint with the vectors and axes of its equation; None where it has no vector."""
        if joint.written.is_own:
            return None
        arrows = [*self.vectors(joint)]
        indices = dict(zip(self._frames(joint), "ij", strict=False))
        for frame, index in indices.items():
            arrows += self._axes(frame, index if frame != GROUND_FRAME else "")
        if GROUND_FRAME not in indices:
            arrows += self._axes(GROUND_FRAME, "")
        title = f"{joint.name}: the vectors of its equation, at {self.evaluation.origin}"
        return picture(self._drawn, self.evaluation.q, title, arrows, self._frames(joint))

    def _frames(self, joint: Joint) -> list[BodyFrame]:
        frames = self._geometry.frames
        return [frames.get(body.name, GROUND_FRAME) for body in joint.bodies]

    def _place(self, frame: BodyFrame, *point: float) -> Array:
        """Return where a point of a frame is, without one its origin."""
        return FramePoint(frame, point or (0.0,) * len(self._letters)).at(self.evaluation.q)

    def _axes(self, frame: BodyFrame, index: str) -> Iterator[Arrow]:
        origin, length = self._place(frame), AXIS * self._drawn.size
        for letter, way in zip(self._letters, np.eye(len(self._letters)) * length, strict=True):
            name = f"{letter}_{index}" if index else letter
            yield Arrow(name, origin, self._place(frame, *way), frame, is_vector=False)

    def vectors(self, joint: Joint) -> Iterator[Arrow]:
        """Yield r of each body, s and v of the joint, and d; those of no length are left out."""
        for arrow in (*self._positions(joint), *self._fixed(joint), *self._separations(joint)):
            if norm(arrow.end - arrow.start) > SHORTEST * self._drawn.size:
                yield arrow

    def _positions(self, joint: Joint) -> Iterator[Arrow]:
        for index, frame in zip("ij", self._frames(joint), strict=False):
            yield Arrow(f"r_{index}", self._place(GROUND_FRAME), self._place(frame), frame)

    def _fixed(self, joint: Joint) -> Iterator[Arrow]:
        """Yield the points of a joint from their origins, and its directions from their points."""
        last: dict[BodyFrame, Array] = {}
        taken: list[Array] = []
        for symbol, is_point in _fixed_vectors(joint):
            frame = self._geometry.frame_of(joint, symbol)
            if is_point:
                end = self._geometry.point(joint, symbol).at(self.evaluation.q)
                last.setdefault(frame, end)
                yield Arrow(symbol, self._place(frame), end, frame)
                continue
            direction = np.array(self._geometry.numbers(joint.points[symbol]), dtype=np.float64)
            start = last.get(frame, self._place(frame))
            length = self._drawn.size * (OF_TRIAD if self._drawn.is_spatial else DIRECTION)
            way = self._place(frame, *(length / norm(direction) * direction)) - self._place(frame)
            ray = np.concatenate((start, way)) / length
            if any(norm(ray - other) < ALIKE for other in taken):
                way = SHORTER * way
            taken.append(ray)
            yield Arrow(symbol, start, start + way, frame, is_direction=True)

    def _separations(self, joint: Joint) -> Iterator[Arrow]:
        """Yield d from where its negative terms end to where its positive ones do."""
        expansion = Expansion(SymbolicEnvironment(joint), joint.template.dimension)
        values = self.evaluation.values

        def where(terms: list[ex.Vector]) -> Array:
            components = expansion.vector(ex.vector_sum(tuple(terms)))
            return np.array([evaluate(value, dict(values)) or 0.0 for value in components])

        for vector, glyph in abbreviations(joint.template).items():
            if isinstance(vector, ex.VectorSum) and not glyph.dots:
                signs = [ex.split_coefficient(ex.split_factor(term)[0])[0] for term in vector.terms]
                pairs = list(zip(vector.terms, signs, strict=True))
                positive = [term for term, sign in pairs if sign > 0]
                negative = [-term for term, sign in pairs if sign < 0]
                name = f"d_{glyph.index}" if glyph.index else "d"
                yield Arrow(name, where(negative), where(positive), GROUND_FRAME)


def _fixed_vectors(joint: Joint) -> Iterator[tuple[str, bool]]:
    """Yield the symbols of what is fixed in bodies, and whether it is a point.

    First the arguments, then what else of the triads about them occurs in the equation.
    """
    arguments = joint.written.arguments().values()
    given = {item.symbol: item.kind for item in arguments if item.kind in (Kind.POINT, Kind.AXIS)}
    yield from ((symbol, kind is Kind.POINT) for symbol, kind in given.items())
    occurring = (item for Phi in joint.template.Phi for item in parts(Phi))
    symbols = dict.fromkeys(x.name for x in occurring if isinstance(x, ex.VectorSymbol))
    yield from ((name, False) for name in symbols if name in joint.points.keys() - given.keys())
