"""C for one point at a time: beside the runtime and the ordinary C, here and on a Cortex-M4."""

import ctypes
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import criteria
from kincompile.emitters.c.float32 import in_float32
from kincompile.runtime.status import Status
from tests import transmission_models as models
from tests.unit.solver.test_text_on_numpy import native_march

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")
OF_FLOATS = (*STRICT, "-Wdouble-promotion")
KINDS: dict[str, Any] = {"float32": np.float32, "float64": np.float64}
X = sympy.Symbol("x")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "on_a_controller.md"
SIZE = """
#include <stddef.h>
size_t size_of_state(void);
size_t size_of_state(void) {{ return sizeof({}_state); }}
"""


def done(*command, cwd, given=None):
    """Run a program that must end well, and say nothing but what it prints."""
    found = subprocess.run(
        command, cwd=cwd, input=given, capture_output=True, text=True, check=False, timeout=60
    )
    assert (found.returncode, found.stderr) == (0, "")
    return found.stdout


class Controller:
    """An emitted library, and a state as an array of its numbers."""

    def __init__(self, emitted, real, folder, compiler):
        self.kind, self.name = KINDS[real], emitted.name
        emitted.write(folder)
        main = next(iter(emitted.files))
        with (folder / main).open("a") as file:
            file.write(SIZE.format(self.name))
        flags = OF_FLOATS if real == "float32" else STRICT
        done(compiler, *flags, "-O1", "-fPIC", "-shared", main, "-lm", "-o", "own.so", cwd=folder)
        self.own = ctypes.CDLL(str(folder / "own.so"))
        self.own.size_of_state.restype = ctypes.c_size_t
        size = self.own.size_of_state()
        assert emitted.needs.startswith(f"{self.name}_state has {size} bytes; a correction")
        self.state = np.zeros(size // self.kind().itemsize, self.kind)

    def call(self, function, *given):
        """Call a function with the state, and numbers or arrays of its type."""
        number = np.ctypeslib.as_ctypes_type(self.kind)
        own = [x.ctypes if isinstance(x, np.ndarray) else number(x) for x in given]
        return getattr(self.own, f"{self.name}_{function}")(self.state.ctypes, *own)


class Motion(Controller):
    """A motion, whose position and rates are read from the state."""

    def __init__(self, module, emitted, real, folder, compiler):
        super().__init__(emitted, real, folder, compiler)
        self.n, self.k = module.N_COORDINATES, max(len(module.PARAMETERS), 1)

    def states(self, k=0, count=3):
        """Return q, q_dot, q_ddot, or the first or later of them, as parts of the state."""
        first = 1 + self.k + k * self.n
        return self.state[first : first + count * self.n].reshape(count, -1)

    def follow(self, t):
        """Return the statuses over times until one fails, and the states of those before."""
        statuses, rows = [], []
        for k, time in enumerate(t):
            statuses.append(self.call("step", time) if k else self.call("begin"))
            if statuses[-1] != Status.CONVERGED:
                break
            rows.append(self.states().astype(float))
        return statuses, np.array(rows)


@pytest.fixture
def motion_of(tmp_path, quick_compiler):
    """Return the function that builds the motion of an example."""

    def built(example, real):
        emitted = kc.emit(example.model, "c", real=real, points="one")
        folder = tmp_path / f"{emitted.name}_{real}"
        found = Motion(example.module, emitted, real, folder, quick_compiler)
        assert found.call("start") == Status.CONVERGED
        return found

    return built


def apart(found, solution, module):
    """Return how far q, q_dot and q_ddot are from a solution, angles and lengths by themselves."""
    is_angle = np.array([module.UNITS[x] in ("rad", "") for x in module.COORDINATES])
    most = 0.0
    for own, name in zip(found.swapaxes(0, 1), ("q", "q_dot", "q_ddot"), strict=True):
        known = getattr(solution, name)
        for kind in (is_angle, ~is_angle):
            if (known[:, kind] != 0).any():
                missed = np.abs(own[:, kind] - known[:, kind]).max()
                most = max(most, float(missed / max(np.abs(known[:, kind]).max(), 1e-3)))
    return most


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "klann", "rssr"])
def test_that_float32_follows_a_turn_to_five_digits(example_named, motion_of, name):
    example = example_named(name)
    t = np.linspace(0, example.model.end, 101).astype(np.float32)
    statuses, found = motion_of(example, "float32").follow(t)
    assert set(statuses) == {Status.CONVERGED}
    assert apart(found, kc.solve(example.module, t.astype(float)), example.module) < 1e-5


@pytest.mark.parametrize("factors", [(1, 1), (1, 0.9), (1, 0.4), (1.5, 0.6)])
def test_that_float64_does_what_the_ordinary_c_does(example_named, motion_of, factors):
    """Over the table of marches, of which some lock up."""
    example, t = example_named("four_bar"), np.linspace(0, 3, 40)
    own = motion_of(example, "float64")
    p = example.module.DEFAULTS * [*factors, 1, 1, 1]
    reached, states, status, _ = native_march(example.native, t, p)
    start = kc.solve(example.module, [0.0], dict(zip("ab", p, strict=False))).q[0]
    own.state[1:6], own.states()[0] = p, start
    statuses, found = own.follow(t)
    assert statuses == status[: len(statuses)].tolist()
    assert len(found) == reached
    assert (Status.LOCK_UP in statuses) == (factors[1] < 0.9)
    for here, known in zip(found.swapaxes(0, 1), states, strict=True):
        there = known[:, :reached].T
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-12 * np.max(abs(there)))


@pytest.mark.parametrize("real", KINDS)
def test_that_a_failed_step_leaves_the_last_position(example_named, motion_of, real):
    example = example_named("four_bar")
    own = motion_of(example, real)
    own.state[2] *= 0.4  # b
    assert own.call("begin") == Status.CONVERGED
    for time in np.linspace(0, 3, 40)[1:]:
        if (status := own.call("step", time)) != Status.CONVERGED:
            break
    assert status == Status.LOCK_UP if real == "float64" else status in (2, 7)
    t, before = float(own.state[0]), own.state[: 6 + 3 * own.n].copy()
    assert 0.1 < t < time
    Phi = example.module.Phi(own.states()[0].astype(float), t, own.state[1:6].astype(float))
    assert np.abs(Phi).max() < (1e-4 if real == "float32" else 1e-9)
    assert own.call("step", time) != Status.CONVERGED  # and so it stays
    np.testing.assert_allclose(own.state[: 6 + own.n], before[: 6 + own.n], rtol=1e-3, atol=1e-3)
    assert own.call("start") == Status.CONVERGED


def test_that_sub_steps_end_where_times_are_not_told_apart(tmp_path, quick_compiler):
    """Before a jump: at 10,000 s times of float32 are 0.001 s apart, and a step is 0.01 s."""
    place = sympy.Piecewise((0, kc.t < 10000.005), (1, True))
    model = kc.ConstraintSystem("jump", ["x"], [X - place])
    emitted = kc.emit(model, "c", real="float32", points="one")
    own = Motion(kc.compile(model), emitted, "float32", tmp_path, quick_compiler)
    assert own.call("start") == Status.CONVERGED
    own.state[0] = 10_000
    assert own.call("begin") == Status.CONVERGED
    assert own.call("step", 10000.01) == Status.NOT_CONVERGED
    iterations = own.state[-6:].view(np.int32)[0]  # the second number of an outcome, of seven
    assert 0 < iterations < 500


def test_that_a_time_that_is_no_number_takes_no_sub_steps(example_named, motion_of):
    own = motion_of(example_named("four_bar"), "float32")
    before = own.states().copy()
    for time in (np.nan, np.inf, -np.inf):
        assert own.call("step", time) == Status.NOT_CONVERGED
        assert own.state[-6:].view(np.int32)[0] < 20  # iterations
        assert own.state[0] == 0
        np.testing.assert_array_equal(own.states(), before)
    assert own.call("step", 0.1) == Status.CONVERGED


@pytest.mark.parametrize("real", KINDS)
def test_that_turns_are_taken_back(example_named, motion_of, real):
    """After a turn the time begins anew, and angles are as they were: float32 keeps its digits."""
    example = example_named("four_bar")
    own, period = motion_of(example, real), 2 * np.pi / example.module.DEFAULTS[4]
    angle = example.module.COORDINATES.index("phi_crank")
    times = np.linspace(0, period, 50)
    first = own.states().copy()
    for _ in range(30):
        assert all(own.call("step", time) == Status.CONVERGED for time in times[1:])
        own.state[0] -= period
        own.states()[0, angle] -= 2 * np.pi
        assert own.call("begin") == Status.CONVERGED
    limit = 4e-6 if real == "float32" else 1e-12
    np.testing.assert_allclose(own.states(), first, rtol=0, atol=limit * np.abs(first).max())


def test_that_the_loop_of_the_page_follows_the_rocker(example_named, tmp_path, quick_compiler):
    """Over three turns, after each of which the time begins anew."""
    example, number = example_named("four_bar"), ctypes.c_float
    (text,) = re.findall(r"<!-- file: loop.c -->\n```c\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "loop.c").write_text(text)
    kc.emit(example.model, "c", real="float32", points="one").write(tmp_path)
    flags = ("-std=c99", "-O1", "-fPIC", "-shared", "loop.c", "four_bar.c", "-lm", "-o", "loop.so")
    done(quick_compiler, *flags, cwd=tmp_path)
    own, angle, speed = ctypes.CDLL(str(tmp_path / "loop.so")), number(), number()
    assert own.prepare()
    t: Any = np.float32(0)
    interval, period = np.float32(0.02), np.float32(2 * np.pi / 1.5)
    times, found = [0.0], [[np.nan, np.nan]]
    for _ in range(650):
        assert own.rocker_after(number(float(interval)), ctypes.byref(angle), ctypes.byref(speed))
        t = np.float32((t - period if t >= period else t) + interval)
        times.append(float(t))
        found.append([angle.value, speed.value])
    turns = np.cumsum(np.diff(times, prepend=0) < 0)
    assert turns[-1] == 3
    solution = kc.solve(example.module, np.array(times) + turns * 2 * np.pi / 1.5)
    known = np.transpose([solution["phi_rocker"], solution["phi_rocker_dot"]])
    np.testing.assert_allclose(found[1:], known[1:], rtol=0, atol=1e-5)


def test_that_outputs_are_in_the_state(example_named, motion_of):
    example = example_named("rssr")
    own, module = motion_of(example, "float64"), example.module
    t = np.linspace(0, 1, 5)
    solution = kc.solve(module, t)
    count, blocks = len(module.OUTPUTS), 1
    for k, time in enumerate(t):
        assert own.call("step", time) == Status.CONVERGED
        first = 1 + own.k + 3 * own.n + blocks_of(module, blocks)
        found = own.state[first : first + 3 * count].reshape(3, -1)
        for own_rows, name in zip(found, ("", "_dot", "_ddot"), strict=True):
            known = [solution[f"{x}{name}"][k] for x in module.OUTPUTS]
            np.testing.assert_allclose(own_rows, known, rtol=1e-10, atol=1e-10)


def blocks_of(module, least):
    """Return how many determinants a state has."""
    with np.errstate(all="ignore"):
        nonzeros = vars(module)["_PHI_Q_NONZEROS"]
        given = [np.ones(1)] * len(nonzeros.places)
        return max(len(module.LANES["factor"](module.ARRAYS, given)[1]), least)


# ------------------------------------------------------------ transmissions

LOOPS = {
    "T1a": (models.crank_rocker, ["motor"], ["phi_rocker"], [[-0.5], [1.2]]),
    "T3-SPU": (models.ankle, ["left", "right"], ["pitch", "roll"], [[-0.01, 0.012]] * 2),
}


@pytest.mark.parametrize("real", KINDS)
@pytest.mark.parametrize("case", LOOPS)
def test_that_a_transmission_is_that_of_the_runtime(case, real, tmp_path, quick_compiler):
    build, inputs, outputs, ways = LOOPS[case]
    f = kc.transmission(build(), inputs, outputs)
    emitted = kc.emit(build(), "c", transmission=(inputs, outputs), real=real, points="one")
    own = Controller(emitted, real, tmp_path, quick_compiler)
    assert "batch" not in emitted.source
    assert own.call("start") == Status.CONVERGED
    path = f.home.u + np.linspace(0, 1, 30)[:, np.newaxis] * np.array(ways)[:, 0][: len(inputs)]
    path = path.astype(KINDS[real])
    poses = f.at(path.astype(float))
    limit = 1e-5 if real == "float32" else 1e-12
    x, slopes = np.zeros(len(outputs), own.kind), np.zeros((len(outputs), len(inputs)), own.kind)
    for u, known, by_u in zip(path, poses.x, poses.J, strict=True):
        assert own.call("transmission", u, x, slopes) == Status.CONVERGED
        np.testing.assert_allclose(x, known, rtol=0, atol=limit * max(1, np.abs(poses.x).max()))
        np.testing.assert_allclose(slopes, by_u, rtol=0, atol=limit * np.abs(poses.J).max())
    beyond = np.full(len(inputs), 50.0 if case == "T3-SPU" else np.nan, own.kind)
    assert own.call("transmission", beyond, x, slopes) in (Status.SINGULAR, Status.NOT_FINITE)
    assert np.isnan(x).all()


# ------------------------------------------------------------ on a controller

ARM, QEMU = shutil.which("arm-none-eabi-gcc"), shutil.which("qemu-system-arm")
FOR_ARM = (
    "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-Os", "-fno-math-errno"
)  # fmt: skip
DATA = Path(__file__).resolve().parents[1] / "data" / "controller"
CALLS = """#include "{main}.h"
static float u[4], x[4], J[16];
#define STATE {name}_state
#define START(s) {name}_start(s)
#define STEP(s, t) {step}
#define PRINT(s) print_floats({shown})
#define COUNT {count}
#define INTERVAL {interval!r}f
static inline void unused(void) {{ (void)u, (void)x, (void)J; }}
"""


@cache
def bare(program):
    """Return a program of the distribution, or skip."""
    if program is None:
        pytest.skip(
            "gcc or QEMU for ARM is not installed "
            "(Debian: gcc-arm-none-eabi, libnewlib-arm-none-eabi, qemu-system-arm)"
        )
    return program


class OnArm:
    """What an emitted module takes on a Cortex-M4 of QEMU, and what it gives."""

    def __init__(self, emitted, folder, step, shown, count, interval):
        gcc, main = bare(ARM), next(iter(emitted.files)).removesuffix(".c")
        emitted.write(folder)
        calls = CALLS.format(
            main=main, name=emitted.name, step=step, shown=shown, count=count, interval=interval
        )
        (folder / "calls.h").write_text(calls)
        done(gcc, *OF_FLOATS, *FOR_ARM, "-c", f"{main}.c", cwd=folder)
        sizes = done("arm-none-eabi-size", f"{main}.o", cwd=folder).splitlines()[1].split()
        self.text, self.data, self.bss = map(int, sizes[:3])
        files = (str(DATA / "controller.c"), f"{main}.o", "-T", str(DATA / "controller.ld"))
        libraries = ("-nostartfiles", "-I.", "-lm", "-lc", "-lgcc", "-o", "whole.elf")
        done(gcc, "-std=c99", *FOR_ARM, *files, *libraries, cwd=folder)
        self.symbols = done("arm-none-eabi-nm", "whole.elf", cwd=folder)
        # one instruction a nanosecond: the clock of 25 MHz ticks every 40 of them
        machine = ("-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none")
        clock = ("-semihosting", "-icount", "shift=0", "-kernel", "whole.elf")
        asked = subprocess.run(
            [bare(QEMU), *machine, *clock], cwd=folder, capture_output=True, text=True,
            check=True, timeout=60,
        )  # fmt: skip
        *rows, last = (asked.stdout + asked.stderr).split("\n")[:-1]
        ticks, self.stack = (int(x, 16) for x in last.split())
        self.instructions = 40 * ticks / (count - 1)
        numbers = np.array([[int(x, 16) for x in row.split()] for row in rows], np.uint32)
        self.status, self.numbers = numbers[:, 0], numbers[:, 1:].copy().view(np.float32)


def test_that_a_four_bar_runs_on_a_cortex_m4(example_named, tmp_path):
    example, count, interval = example_named("four_bar"), 90, 0.05
    emitted = kc.emit(example.model, "c", real="float32", points="one")
    found = OnArm(emitted, tmp_path, "four_bar_step(s, t)", "(s)->q, 3 * 9", count, interval)
    assert set(found.status) == {Status.CONVERGED}
    t = np.arange(count, dtype=np.float32) * np.float32(interval)
    solution = kc.solve(example.module, t.astype(float))
    assert apart(found.numbers.reshape(count, 3, -1), solution, example.module) < 1e-5
    assert found.text <= 4500
    assert (found.data, found.bss) == (0, 0)
    assert found.stack <= 600
    assert found.instructions <= 6000
    assert re.search(r" T four_bar_step\n", found.symbols)
    # neither memory from a heap nor doubles
    assert not re.search(r"malloc|sbrk|__aeabi_d|__aeabi_f2d|__aeabi_\w*2d\b", found.symbols)


def test_that_a_transmission_runs_on_a_cortex_m4(tmp_path):
    count, interval = 60, 0.02
    ends = ["motor"], ["phi_rocker"]
    f = kc.transmission(models.crank_rocker(), *ends)
    emitted = kc.emit(models.crank_rocker(), "c", transmission=ends, real="float32", points="one")
    first = np.float32(f.home.u[0])
    step = f"(u[0] = {float(first)!r}f + (t), four_bar_transmission(s, u, x, J))"
    found = OnArm(
        emitted,
        tmp_path,
        step,
        "(s)->q, 1), print_floats(x, 1), print_floats(J, 1",
        count,
        interval,
    )
    u = first + np.arange(count, dtype=np.float32) * np.float32(interval)
    poses = f.at(u.astype(float)[:, np.newaxis])
    assert set(found.status) == {Status.CONVERGED}
    np.testing.assert_allclose(found.numbers[1:, 1], poses.x[1:, 0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.numbers[1:, 2], poses.J[1:, 0, 0], rtol=0, atol=1e-5)
    assert found.text <= 2000
    assert found.stack <= 400
    assert found.instructions <= 2000


# ------------------------------------------------------------ what is refused


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "float32 for many points": ({"real": "float32"}, "give points='one' too"),
    "other numbers": ({"real": "float16", "points": "one"}, "real is float64 or float32"),
    "other points": ({"points": "two"}, "points are many or one"),
    "another target": ({"target": "rust", "points": "one"}, "'rust' has no code for one point"),
    "equations of motion": ({"points": "one", "dynamics": True}, "leave out dynamics"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_that_other_forms_are_refused(example_named, what):
    given, message = REFUSED[what]
    with pytest.raises((kc.InputError, kc.UnsupportedError), match=re.escape(message)):
        kc.emit(example_named("balanced_four_bar").model, **{"target": "c"} | given)


def crank(angle, length=1.0):
    """Return a crank that is driven."""
    m = kc.Mechanism("crank")
    body = m.body("crank", (length, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), body, (-length, 0)))
    if angle is not None:
        m.add(kc.AbsoluteAngle("motor", body, angle))
    return m


def beside(place):
    """Return a slider crank that stands beside the origin."""
    m = kc.Mechanism("beside")
    body = m.body("crank", (place + 1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (place, 0), body, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t))
    return m


def dead_centre():
    """Return a crank and a rod in one line, which the rod's end drives."""
    m = kc.Mechanism("dead")
    first, second = m.body("first", (0.5, 0, 0)), m.body("second", (1.5, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), first, (-0.5, 0)))
    m.add(kc.Revolute("B", first, (0.5, 0), second, (-0.5, 0)))
    m.add(kc.AbsoluteY("C", second, (0.5, 0), 0))
    m.add(kc.AbsoluteX("D", second, (0.5, 0), 2 - 1e-9 - kc.t))
    return m


UNREACHED = {
    "no driver": (lambda: crank(None), "there is no motion to follow"),
    "no position": (lambda: kc.ConstraintSystem("none", ["x"], [X**2 + 1]), "no position of none"),
    "far away": (lambda: beside(1e4), "x_crank is 10001 at t = 0, which float32 knows to 0.001"),
    "many turns": (lambda: crank(700 + kc.t), "1e-05 of 1 rad"),
    "a dead centre": (dead_centre, "near a singular position at t = 0"),
    "a large number": (lambda: crank(kc.t, 1e39), "is no number of float32"),
}


@pytest.mark.filterwarnings("ignore::kincompile.AssemblyWarning")
@pytest.mark.parametrize("what", UNREACHED)
def test_that_what_float32_cannot_reach_is_refused(what):
    build, message = UNREACHED[what]
    with pytest.raises(kc.KincompileError, match=re.escape(message)):
        kc.emit(build(), "c", real="float32", points="one")


def test_that_text_of_doubles_becomes_text_of_floats():
    given = 'double a = sin(1.5e-3) + 2.0 * doubled[1]; // 1e-10 double\n#include "d1.0.h"\n'
    wanted = 'float a = sinf(1.5e-3f) + 2.0f * doubled[1]; // 1e-10 double\n#include "d1.0.h"\n'
    assert in_float32(given) == wanted
    with pytest.raises(kc.UnsupportedError, match="1e-40 is no number of float32"):
        in_float32("a = 1e-40;")


def test_that_criteria_of_float32_keep_their_share_of_the_digits():
    eps = np.finfo(np.float32).eps
    tolerance = criteria.for_float32("TOLERANCE")
    assert eps < tolerance**2 * 100 < 2e-7  # what is left of the last correction is rounding
    assert criteria.for_float32("ROUNDING") == 16 * eps
    assert criteria.for_float32("KINK") == criteria.KINK
