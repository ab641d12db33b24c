"""The public names and where each is defined: for type checkers, and for `__init__.py`.

`__init__.py` reads the lines below and loads a name when it is first used. The types of constraints
are those of the catalogue. A name is stable unless its line says `provisional`; a `result` is
returned by calls, and `dir` leaves it out with the errors and warnings. docs/api.md shows all.
"""

from kincompile.checker.compare import compare as compare
from kincompile.checker.compare import compare_file as compare_file
from kincompile.classical import linkages as linkages  # provisional
from kincompile.classical import synthesis as synthesis  # provisional
from kincompile.compiler import compile as compile  # noqa: A004
from kincompile.compiler import emit as emit
from kincompile.compiler import inspect as inspect
from kincompile.derivations.derivation import derivation as derivation
from kincompile.design import targets as targets  # provisional
from kincompile.design.deviation import Deviation as Deviation
from kincompile.design.fit import fit as fit  # provisional
from kincompile.design.fitted import Fit as Fit  # result, provisional
from kincompile.design.tolerance import tolerance as tolerance
from kincompile.design.tolerance_analysis import ToleranceAnalysis as ToleranceAnalysis  # result
from kincompile.errors import AssemblyWarning as AssemblyWarning
from kincompile.errors import BranchSwitchWarning as BranchSwitchWarning
from kincompile.errors import ContractError as ContractError
from kincompile.errors import CornerWarning as CornerWarning
from kincompile.errors import DamagedStoreWarning as DamagedStoreWarning
from kincompile.errors import InputError as InputError
from kincompile.errors import InternalError as InternalError
from kincompile.errors import KincompileError as KincompileError
from kincompile.errors import ModelError as ModelError
from kincompile.errors import RedundantConstraintWarning as RedundantConstraintWarning
from kincompile.errors import SingularConfigurationWarning as SingularConfigurationWarning
from kincompile.errors import SolveError as SolveError
from kincompile.errors import StructuralError as StructuralError
from kincompile.errors import SweepError as SweepError
from kincompile.errors import TemplateError as TemplateError
from kincompile.errors import UnsupportedError as UnsupportedError
from kincompile.exercises.kit import exercise as exercise
from kincompile.exercises.marking import mark as mark
from kincompile.files.file_format import model_schema as model_schema
from kincompile.files.files import read as read
from kincompile.files.files import read_analysis as read_analysis
from kincompile.files.files import read_model as read_model
from kincompile.functions.differentiable import jax as jax  # provisional
from kincompile.functions.poses import Poses as Poses  # result, provisional
from kincompile.functions.transmission import Transmission as Transmission  # result, provisional
from kincompile.functions.transmission import transmission as transmission  # provisional
from kincompile.model import motion as motion
from kincompile.model import outputs as outputs
from kincompile.model.catalogue import *
from kincompile.model.equation import Equation as Equation
from kincompile.model.expressions import alpha as alpha
from kincompile.model.expressions import deg as deg
from kincompile.model.expressions import pi as pi
from kincompile.model.expressions import t as t
from kincompile.model.loads import FollowerForce as FollowerForce
from kincompile.model.loads import Force as Force
from kincompile.model.loads import HingeFriction as HingeFriction
from kincompile.model.loads import SliderFriction as SliderFriction
from kincompile.model.loads import Spring as Spring
from kincompile.model.loads import Torque as Torque
from kincompile.model.loads import TorsionSpring as TorsionSpring
from kincompile.model.mechanism import Mechanism as Mechanism
from kincompile.model.sketch import Sketch as Sketch
from kincompile.model.system import ConstraintSystem as ConstraintSystem
from kincompile.runtime.dynamics.simulate import simulate as simulate
from kincompile.runtime.load import load as load
from kincompile.runtime.newton import newton as newton
from kincompile.runtime.results.forces import Forces as Forces  # result
from kincompile.runtime.results.forces import forces as forces
from kincompile.runtime.results.sensitivities import Sensitivities as Sensitivities  # result
from kincompile.runtime.results.sensitivities import sensitivities as sensitivities
from kincompile.runtime.results.solution import Solution as Solution  # result
from kincompile.runtime.results.write import write as write
from kincompile.runtime.singular.assemblies import assemblies as assemblies
from kincompile.runtime.singular.events import Event as Event  # result
from kincompile.runtime.solve import solve as solve
from kincompile.runtime.statics.equilibrium import Equilibrium as Equilibrium  # result
from kincompile.runtime.statics.equilibrium import equilibria as equilibria  # provisional
from kincompile.runtime.statics.equilibrium import equilibrium as equilibrium
from kincompile.runtime.statics.flywheel import Flywheel as Flywheel  # result, provisional
from kincompile.runtime.statics.flywheel import flywheel as flywheel  # provisional
from kincompile.runtime.status import Status as Status  # result
from kincompile.runtime.stepper import Instant as Instant  # result, provisional
from kincompile.runtime.stepper import Stepper as Stepper  # result, provisional
from kincompile.runtime.stepper import stepper as stepper  # provisional
from kincompile.runtime.times import times_at as times_at
from kincompile.sweeps.result import Sweep as Sweep  # result, provisional
from kincompile.sweeps.sweep import sweep as sweep  # provisional
from kincompile.verification.verify import verify as verify
from kincompile.view.animation import animate as animate
from kincompile.view.draw import draw as draw
from kincompile.view.editor import editor as editor  # provisional
from kincompile.view.gallery import assembly_gallery as assembly_gallery  # provisional
from kincompile.view.gallery import gallery as gallery
from kincompile.view.mechanism_plot import plot_mechanism as plot_mechanism
from kincompile.view.page import page as page
from kincompile.view.sparsity_plot import plot_sparsity as plot_sparsity

__all__: list[str]
__version__: str
