"""The march of the Rust target: what the solver's text does on NumPy, one point at a time."""

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.status import Status
from tests.targets.conftest import run_rust
from tests.unit.solver.conftest import marched, start_of

pytestmark = pytest.mark.slow

T = np.linspace(0, 3, 40)
CASES = {
    "four_bar": [[1.0, 1.0], [1.0, 0.9], [1.0, 0.4]],  # the last locks up
    "rssr": [[1.0, 1.0], [1.05, 1.0]],
}
"""Factors of the first two parameters."""

# Follows motions, and then all of them together, from numbers in order.
FOLLOWED = """macro_rules! followed {
    ($m:ident, $line:expr) => {
        let numbers: Vec<f64> = $line.split(" ").map(|x| x.parse().unwrap()).collect();
        let (size, count, sets) = (numbers[0], numbers[1] as usize, numbers[2] as usize);
        let (t, rest) = numbers[3..].split_at(count);
        let (guess, p) = rest.split_at($m::N_COORDINATES);
        for own in p.chunks($m::N_PARAMETERS) {
            let own: &[f64; $m::N_PARAMETERS] = own.try_into().unwrap();
            let found = $m::motion(t, own, guess.try_into().unwrap(), size);
            println!("{:?}", found.status);
            println!("{:?}", found.iterations);
            println!("{:?}", [found.q, found.q_dot, found.q_ddot].concat());
        }
        let all = count * sets;
        let numbers = all * $m::N_COORDINATES;
        let mut states = vec![0.0; 3 * numbers];
        let (q, rates) = states.split_at_mut(numbers);
        let (q_dot, q_ddot) = rates.split_at_mut(numbers);
        let mut residual = vec![0.0; all];
        let (mut status, mut iterations) = (vec![0; all], vec![0; all]);
        $m::march_variants(&mut $m::Variants {
            count, variants: sets, t, p, guess: &guess.repeat(sets), size, tolerance: 1e-10,
            max_iterations: 25, q, q_dot, q_ddot,
            residual: &mut residual, status: &mut status, iterations: &mut iterations,
        });
        println!("{:?}", status);
        println!("{:?}", iterations);
        println!("{:?}", states);
    };
}
"""


@pytest.fixture(scope="module")
def printed(example_named, tmp_path_factory):
    """What the program prints of each example: three lines a motion, and three of all together."""
    folder = tmp_path_factory.mktemp("rust")
    lines, calls, given = [], [], []
    for name, factors in CASES.items():
        example = example_named(name)
        kc.emit(example.model, "rust").write(folder)
        guess, size = start_of(example.module, 0.0)
        numbers = [size, T.size, len(factors), *T, *guess, *np.ravel(sets_of(example.module, name))]
        given.append(" ".join(repr(float(x)) for x in numbers))
        lines.append(f"mod {name};")
        calls.append(f"followed!({name}, lines.next().unwrap());")
    read = "let mut text = String::new(); std::io::stdin().read_to_string(&mut text).unwrap();"
    main = ["use std::io::Read;", "fn main() {", read, "let mut lines = text.lines();", *calls, "}"]
    rows = iter(run_rust(folder, "\n".join([*lines, FOLLOWED, *main]), "\n".join(given)))
    return {name: [next(rows) for _ in range(3 * len(CASES[name]) + 3)] for name in CASES}


def sets_of(module, name):
    """Return the parameter sets of an example."""
    sets = np.repeat([module.DEFAULTS], len(CASES[name]), axis=0)
    sets[:, :2] *= CASES[name]
    return sets


def numbers_in(line):
    return np.array([float(x) for x in line.strip("[]").split(", ")])


@pytest.mark.parametrize("name", CASES)
def test_that_a_motion_is_that_of_the_text(printed, example_named, name):
    module = example_named(name).module
    for k, p in enumerate(sets_of(module, name)):
        reached, found = marched(module, 1, T, [p])
        status, iterations, states = map(numbers_in, printed[name][3 * k : 3 * k + 3])
        np.testing.assert_array_equal(status, found.status)
        # The first is found by the start, which sees by the equations that it is at its end.
        np.testing.assert_array_equal(iterations[1:], found.iterations[1:])
        rows = states.reshape(3, T.size, -1)[:, :reached]
        for here, known in zip(rows, (found.q, found.q_dot, found.q_ddot), strict=True):
            there = known.T[:reached]
            np.testing.assert_allclose(here, there, rtol=1e-7, atol=1e-8 * np.max(abs(there)))
    if name == "four_bar":
        assert Status.LOCK_UP in status
        expected = kc.solve(module, T)
        first = numbers_in(printed[name][2]).reshape(3, T.size, -1)
        np.testing.assert_allclose(first[0], expected.q, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_that_parameter_sets_end_as_each_does_alone(printed, name):
    *alone, status, _, states = printed[name]
    together = numbers_in(status).reshape(T.size, -1).T
    np.testing.assert_array_equal(together, [numbers_in(line) for line in alone[::3]])
    q = numbers_in(states).reshape(3, T.size, len(CASES[name]), -1)[0]
    first = numbers_in(alone[2]).reshape(3, T.size, -1)[0]
    np.testing.assert_allclose(q[:, 0], first, rtol=0, atol=1e-9)
