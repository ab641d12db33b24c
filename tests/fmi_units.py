"""Units for co-simulation as FMPy loads them, with names in the place of value references."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import fmpy
from fmpy.fmi3 import FMU3Slave

import kincompile as kc
from tests import transmission_models

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

COUNT = 41


def slider_crank(length=0.3, **more):
    """Return a slider-crank; with a rod shorter than its crank it locks up."""
    m = kc.Mechanism("slider_crank", end=2.0, points=COUNT, **more)
    r, rod_length = m.parameter("r", 0.1, "m"), m.parameter("L", length, "m")
    crank, rod = m.body("crank"), m.body("rod", guess=(0.25, 0, 0))
    slider = m.body("slider", guess=(0.4, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (r, 0), rod, (-rod_length / 2, 0)))
    m.add(kc.Revolute("B", rod, (rod_length / 2, 0), slider, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    m.point("P", rod, (0, 0.02))
    m.output("stroke", 2 * slider.x, "m")
    m.output("speed", rod.phi_dot, "rad/s")
    return m


def written(folder, name, model, **how):
    """Return the path of a unit, in a folder whose name has a blank."""
    (path,) = kc.emit(model, "fmi", **how).write(folder / "a folder" / f"{name}.fmu")
    return path


ENDS = ["motor_1", "motor_2"], ["end"]
MODELS = {
    "slider": (slider_crank, {}),
    "locked": (lambda: slider_crank(0.09), {}),
    "crank": (transmission_models.crank_rocker, {"transmission": (["motor"], ["phi_rocker"])}),
    "five_bar": (transmission_models.five_bar, {"transmission": ENDS}),
}
"""A motion, one that locks up, and two loops as functions."""


class Units(dict[str, "Path"]):
    """Paths of the units of models, which are built when they are first wanted."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __missing__(self, name: str) -> Path:
        model, how = MODELS[name]
        self[name] = written(self.folder, name, model(), **how)
        return self[name]


class Instance:
    """A unit that was loaded, with names in the place of value references."""

    def __init__(self, path: Path, said: list[str], token: str | None = None) -> None:
        self.said = said
        self.about = fmpy.read_model_description(str(path))
        self.place = {x.name: x.valueReference for x in self.about.modelVariables}
        self.fmu = FMU3Slave(
            instanceName="one",
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=self.about.coSimulation.modelIdentifier,
            guid=token or self.about.guid,
        )
        self.fmu.instantiate(logMessage=lambda *given: self.said.append(given[3].decode()))

    def begin(self, t: float = 0.0) -> Instance:
        self.fmu.enterInitializationMode(startTime=t)
        self.fmu.exitInitializationMode()
        return self

    def step(self, t: float, h: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def put(self, **values: float) -> None:
        self.fmu.setFloat64([self.place[x] for x in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getFloat64([self.place[x] for x in names]))


@contextmanager
def instance_of(path: Path) -> Iterator[Instance]:
    """Yield a new instance, and free it."""
    made = Instance(path, [])
    yield made
    made.fmu.freeInstance()
