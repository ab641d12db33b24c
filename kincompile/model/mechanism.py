"""`Mechanism`: the builder a person writes with."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

import sympy

from kincompile.errors import ModelError
from kincompile.model import outputs
from kincompile.model.bodies import GROUND, Body, Parameter, default_values
from kincompile.model.constraint import Constraint, Element
from kincompile.model.drawn_joints import with_places, with_points
from kincompile.model.equation import Equation
from kincompile.model.expressions import evaluate
from kincompile.model.limits import JointLimit
from kincompile.model.matrices import MatrixViews
from kincompile.model.outputs import Output
from kincompile.model.points import BodyPoint
from kincompile.model.system import ConstraintSystem
from kincompile.model.text_views import TextViews

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.arguments import BodyLike
    from kincompile.model.expressions import Scalar, Scalars
    from kincompile.model.scope import Point

Item = TypeVar("Item", bound=Element | Equation)
Model = TypeVar("Model", bound="Mechanism")


class Mechanism(MatrixViews, TextViews):
    """Bodies, parameters and constraints, collected one by one.

    Nothing is checked while building; `system` checks everything at once, so that all mistakes are
    reported together.

    Parameters
    ----------
    name
        Name of the mechanism; it becomes the name of the emitted module.
    length_unit, mass_unit
        Units of lengths and of masses: ``"m"``, ``"mm"``, ``"in"`` and so on; ``"kg"``, ``"g"``,
        ``"t"`` or ``"lb"``. Forces are in newtons, torques in newtons times the unit of length.
    end, points
        Default time grid of an analysis: `points` equally spaced times from 0 to `end`, a number or
        an expression of parameters: ``60 / n`` is a revolution at n rpm.

    Attributes
    ----------
    ground
        The fixed frame.
    gravity
        Acceleration of gravity (g_x, g_y), none at first: ``m.gravity = (0, -9.81)``.
    outline
        What the ground looks like, as the `outline` of a body: for pictures, none at first.
    tasks
        The tables ``tolerance``, ``fit`` and ``sweep`` of the file that it was read from, as data:
        commands of these names read them, and `to_toml` writes them.
    drawn
        Of a drawing the places of joints by name, in the frame of each body by its name.
    links
        Of a robot's file the body of each link by its name there, and its placement (4, 4) on it.
    limits
        Limits of joints, as `limit` makes them.
    """

    fixed: ClassVar[Body] = GROUND
    point_type: ClassVar[type[BodyPoint]] = BodyPoint
    limit_type: ClassVar[type[JointLimit]] = JointLimit

    def __init__(
        self,
        name: str,
        *,
        length_unit: str = "m",
        mass_unit: str = "kg",
        end: Scalar = 1.0,
        points: int = 101,
    ) -> None:
        self.name = name
        self.length_unit = length_unit
        self.mass_unit = mass_unit
        self.end_given = end
        self.points = points
        self.ground = self.fixed
        self.bodies: list[Body] = []
        self.parameters: list[Parameter] = []
        self.constraints: list[Constraint | Equation] = []
        self.outputs: list[BodyPoint | Output] = []
        self.loads: list[Element] = []
        self.gravity: Scalars = (0,) * len(self.fixed.kind.axes)
        self.outline: Any = ()
        self.tasks: Mapping[str, Any] = {}
        self.drawn: dict[str, Mapping[str, Point]] = {}
        self.links: Mapping[str, tuple[str, Any]] = {}
        self.limits: list[JointLimit] = []

    @property
    def end(self) -> float:
        """The last time, a number at the default parameters; `end_given` is it as it was given."""
        given = self.end_given
        if isinstance(given, sympy.Expr):
            found = evaluate(given, default_values(self.parameters))
            return math.nan if found is None else found
        return given

    @end.setter
    def end(self, given: Scalar) -> None:
        self.end_given = given

    def parameter(
        self,
        name: str,
        default: Scalar | None = None,
        unit: str = "",
        range: Scalars | None = None,  # noqa: A002
    ) -> sympy.Symbol:
        """Declare a parameter and return its symbol, to be used in attributes and drivers.

        Parameters
        ----------
        name
            Name of the parameter.
        default
            Its value where none is given at run time; an angle may be ``30*kc.deg``.
        unit
            Its unit, for documentation.
        range
            Its least and its greatest value on the slider of a page, as ``(0.05, 0.2)``; without,
            half and double its default.
        """
        # `system` makes numbers of them.
        limits = cast("tuple[float, float] | None", range)
        self.parameters.append(Parameter(name, cast("float", default), unit, limits))
        return sympy.Symbol(str(name))

    def body(
        self,
        name: str,
        guess: Scalars = (0, 0, 0),
        outline: Sequence[Scalars] = (),
        *,
        mass: Scalar | None = None,
        inertia: Scalar | None = None,
        centre: Scalars = (0, 0),
        density: Scalar | None = None,
        thickness: Scalar | None = None,
    ) -> Body:
        """Add a body with coordinates (x, y, phi) and return it.

        Parameters
        ----------
        name
            Name of the body.
        guess
            Start values of x, y [length] and phi [rad] for Newton's method, numbers or expressions
            of parameters.
        outline
            Corners (xi, eta) of a closed polygon in the body's frame [length], in order, numbers or
            expressions of parameters: what the body looks like. Without, it is drawn as a link
            through its joint points. The outlines of bodies added before hide it.
        mass, inertia
            Mass, and moment of inertia about the centre of mass, numbers or expressions of
            parameters; both or none.
        centre
            Centre of mass (xi, eta) in the body's frame [length].
        density, thickness
            In place of the three: those of a plate with this outline.
        """
        body = Body(
            name, guess, outline, mass=mass, inertia=inertia, centre=centre, density=density,
            thickness=thickness,
        )  # fmt: skip
        self.bodies.append(body)
        return body

    def point(self, name: str, body: BodyLike, local: Scalars) -> BodyPoint:
        """Name a point of a body and return it: a coupler point, a foot, the end of an arm.

        Parameters
        ----------
        name
            Name of the point; the columns of a solution are ``x_<name>`` and ``y_<name>`` [length],
            and their rates.
        body
            The body, or its name.
        local
            (xi, eta) in the body's frame [length], numbers or expressions of parameters.

        Returns
        -------
        BodyPoint
            Its coordinates ``.x`` and ``.y`` are expressions for equations and outputs, and it may
            stand where a joint wants a body and a point.
        """
        known = {item.name: item for item in (self.ground, *self.bodies)}
        named = body if isinstance(body, Body) else known.get(body, type(self.fixed)(body))
        point = self.point_type(name, named, local)
        self.outputs.append(point)
        return point

    def output(self, name: str, expression: Scalar, unit: str = "") -> Scalar:
        """Ask for an expression over the motion, with its time derivatives, and return it.

        Parameters
        ----------
        name
            Its name; the columns of a solution are ``<name>``, ``<name>_dot`` and ``<name>_ddot``.
        expression
            An expression of coordinates, parameters and `t`, and of rates such as
            ``crank.phi_dot`` or ``kc.outputs.rate(foot.x)``. `kincompile.outputs` has angles,
            distances, speeds, transmission angles and velocity ratios, of points or of the names of
            points and drawn joints. The derivatives of one with
            rates go as far as second rates; what would need a third is NaN.
        unit
            Its unit.
        """
        made = with_points(expression, vars(outputs), self.named_points())
        self.outputs.append(Output(name, made, unit))
        return cast("Scalar", made)

    def limit(
        self,
        joint: Constraint | str,
        least: Scalar = -math.inf,
        greatest: Scalar = math.inf,
        **crosses: Any,
    ) -> JointLimit:
        """Give a joint or a driver limits; a solution says which a motion leaves, and when.

        Parameters
        ----------
        joint
            A hinge, a slider or a driver, or its name. The value of a hinge is the angle from body
            i to body j; of a slider, how far the point of body j is along the axis of body i from
            its point; of a driver, what it drives.
        least, greatest
            Its least and its greatest value [rad or length], numbers or expressions of parameters.
        **crosses
            In space: `cross_i` and `cross_j`, directions on the bodies from which and to which the
            angle of a hinge counts. Without, they are the axes of the bodies that are farthest from
            the axis of the hinge.
        """
        name = str(getattr(joint, "name", joint))
        made = self.limit_type(name, least, greatest, **crosses)
        self.limits.append(made)
        return made

    def named_points(self) -> dict[str, BodyPoint]:
        """Return the named points and the joints of a drawing, each on the first link with it."""
        known = {item.name: item for item in (self.ground, *self.bodies)}
        joints = {
            joint: self.point_type(joint, known[body], place)
            for body, places in reversed(self.drawn.items())
            for joint, place in places.items()
            if body in known
        }
        return joints | {item.name: item for item in self.outputs if isinstance(item, BodyPoint)}

    def add(self, constraint: Item) -> Item:
        """Add a joint, a driver, a free equation or a load, and return it.

        Its equations are the next rows of the system, its contact parameters the next coordinates.
        A point may be the name of a joint that is drawn on its body.
        """
        if not isinstance(constraint, Element):
            self.constraints.append(cast("Equation", constraint))
            return constraint
        *others, own = with_places(constraint, self.drawn).with_own()
        for item in (*others, own):
            if item.is_load:
                self.loads.append(item)
            else:
                self.constraints.append(cast("Constraint", item))
        return cast("Item", own)

    def written(self) -> list[Constraint | Equation]:
        """Return the constraints in the order of their rows."""
        return self.constraints

    def system(self) -> ConstraintSystem:
        """Check the mechanism and return it as a frozen `ConstraintSystem`.

        Raises
        ------
        ModelError
            If it cannot be used as written; every problem is listed.
        """
        return ConstraintSystem(
            self.name,
            equations=self.written(),
            parameters=self.parameters,
            bodies=self.bodies,
            outputs=self.outputs,
            loads=self.loads,
            gravity=self.gravity,
            ground=replace(self.ground, outline=self.outline),
            length_unit=self.length_unit,
            mass_unit=self.mass_unit,
            end=self.end_given,
            points=self.points,
            tasks=self.tasks,
            links=self.links,
            limits=self.limits,
        )

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the freedoms that are held because nothing sees them, one for each.

        Such as ``"spin of rod"``. They are found as `compile` and `inspect` find them.
        """
        found: tuple[str, ...] = import_module("kincompile.further").held_system(self.system()).held
        return found

    def __repr__(self) -> str:
        """Return name and sizes."""
        sizes = f"{len(self.bodies)} bodies, {len(self.constraints)} constraints"
        return f"<Mechanism {self.name!r}: {sizes}>"


def changed(model: Model, **parts: Any) -> Model:
    """Return a mechanism with other parts, ``bodies=[...]``; it keeps all others."""
    made = copy.copy(model)
    for name, part in parts.items():
        setattr(made, name, part)
    return made


def system_of(model: Mechanism | ConstraintSystem) -> ConstraintSystem:
    """Return the checked system of what a user gives as a model.

    Raises
    ------
    ModelError
        If it is no model, or one that cannot be used as written.
    """
    if not isinstance(model, Mechanism | ConstraintSystem):
        raise ModelError(
            f"{type(model).__name__} is not a model: give a kc.Mechanism or a kc.ConstraintSystem "
            "(a file is read by kc.read_model)"
        )
    return model.system()
