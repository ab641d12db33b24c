"""Calls of an emitted transmission in each language; a call gives a line of numbers."""

import json
import subprocess
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.targets.conftest import NEEDED, NODE, OCTAVE, RUSTC, run_octave, run_rust


@dataclass(frozen=True)
class Found:
    """What a call gives."""

    status: int
    x: Any
    J: Any
    effort: Any


def start(*given):
    """Begin at the position of the model, or near others: inputs, coordinates and parameters."""
    return "start", given


def go(*u):
    """Go on to inputs."""
    return "go", u


def path(*points):
    """Go on to the points of a path in one call; it gives a list."""
    return "path", points


def found_of(line, m, n):
    """Return what a line of numbers says: those of x, J and effort follow the status."""
    status, *numbers = line
    x, slopes, effort = np.split(np.array(numbers, dtype=float), (m, m + m * n))
    return Found(int(status), x, slopes.reshape(m, n), effort)


def text_of(values):
    """Return numbers as C and Rust read them."""
    return ", ".join(repr(float(x)) for x in values)


def in_python(emitted, calls, tau, folder):
    """Call the NumPy module."""
    module: dict[str, Any] = {}
    exec(compile(emitted.source, emitted.name, "exec"), module)
    state: Any = None
    lines: list[Any] = []
    for kind, given in calls:
        if kind == "start":
            defaults = [module[x] for x in "UQP"]
            u, q, p = list(given) + defaults[len(given) :]
            state, status = module["start"](p, u, q)
            lines.append([status])
            continue
        if kind == "path":
            found = list(zip(*module["transmission_batch"](state, given), strict=True))
        else:
            found = [module["transmission"](state, given)]
        for x, slopes, status in found:
            numbers = [*map(float, np.ravel(slopes)), *module["effort"](slopes, tau)]
            lines.append([status, *map(float, x), *numbers])
    return lines


def in_c(emitted, calls, tau, folder, compiler="cc"):
    """Call the C functions from a program."""
    name, m = emitted.name, len(tau)
    steps = []
    for kind, given in calls:
        if kind == "go":
            steps.append(f"go((double[]){{{text_of(given)}}});")
            continue
        if kind == "path":
            steps.append(f"path({len(given)}, (double[]){{{text_of(np.ravel(given))}}});")
            continue
        steps.append(f"status = {name}_start(&s);")
        for vector, values in zip("uqp", given, strict=False):
            own = text_of(values) or "0"
            size = len(values)
            steps.append(f"memcpy(s.{vector}, (double[]){{{own}}}, {size} * sizeof(double));")
        steps.append(f"status = {name}_begin(&s);" if given else "")
        steps.append('printf("%d\\n", status);')
    n = inputs_of(calls)
    main = f"""#include "{name}_transmission.h"
#include <stdio.h>
#include <string.h>
static {name}_state s;
static const double given[] = {{{text_of(tau)}}};
static void show(int status, const double *x, const double *J)
{{
    double tau[{n}];
    printf("%d", status);
    {name}_effort(J, given, tau);
    for (int k = 0; k < {m}; k++) printf(" %.17g", x[k]);
    for (int k = 0; k < {m * n}; k++) printf(" %.17g", J[k]);
    for (int k = 0; k < {n}; k++) printf(" %.17g", tau[k]);
    printf("\\n");
}}
static inline void go(const double *u)
{{
    double x[{m}], J[{m * n}];
    show({name}_transmission(&s, u, x, J), x, J);
}}
static inline void path(int count, const double *u)
{{
    static double x[{MOST * m}], J[{MOST * m * n}];
    static int status[{MOST}];
    {name}_transmission_batch(&s, count, u, NULL, x, J, NULL, status);
    for (int k = 0; k < count; k++) show(status[k], x + {m} * k, J + {m * n} * k);
}}
int main(void)
{{
    int status;
    {"".join(steps)}
    return 0;
}}
"""
    (folder / "main.c").write_text(main)
    strict = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")
    files = [f for f in emitted.files if f.endswith(".c")]
    for command in ((compiler, *strict, "main.c", *files, "-lm", "-o", "main"), ("./main",)):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
    return [list(map(float, line.split())) for line in done.stdout.splitlines()]


def in_javascript(emitted, calls, tau, folder):
    """Call the script under node."""
    script = f"""const m = require("./{emitted.name}_transmission.js");
let s;
const show = (status, x, J) => {{
    const rows = J.map(row => Array.from(row)).flat();
    console.log([status, ...x, ...rows, ...m.effort(J, {json.dumps(tau)})].join(" "));
}};
for (const [kind, given] of {json.dumps(calls)}) {{
    if (kind === "start") {{
        const [u, q, p] = given;
        s = m.start(p, u, q);
        console.log(s.status);
    }} else if (kind === "path") {{
        const {{ x, J, status }} = m.transmission_batch(s, given);
        given.forEach((_, k) => show(status[k], x[k], J[k]));
    }} else {{
        const {{ x, J, status }} = m.transmission(s, given);
        show(status, x, J);
    }}
}}"""
    (folder / "main.js").write_text(script)
    command = (str(NODE), "main.js")
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return [list(map(float, line.split())) for line in done.stdout.splitlines()]


def in_rust(emitted, calls, tau, folder):
    """Call the Rust module from a program."""
    steps = []
    for kind, given in calls:
        if kind == "go":
            steps.append(f"go(&mut s, [{text_of(given)}]);")
            continue
        if kind == "path":
            points = ", ".join(f"[{text_of(u)}]" for u in given)
            steps.append(f"path(&mut s, &[{points}]);")
            continue
        u, q, p = (f"&[{text_of(x)}]" for x in (*given, *[()] * (3 - len(given))))
        own = (p if len(given) > 2 else "&m::P", *((u, q) if given else ("&m::START_U", "&m::Q")))
        steps.append(f"let (mut s, status) = m::start({', '.join(own)});")
        steps.append('println!("{}", status);')
    main = f"""#![allow(unused)]
mod {emitted.name}_transmission;
use {emitted.name}_transmission as m;
fn go(s: &mut m::Transmission, u: [f64; m::U]) {{
    let (x, slopes, status) = m::transmission(s, &u);
    show(x, slopes, status);
}}
fn path(s: &mut m::Transmission, u: &[[f64; m::U]]) {{
    let (mut x, mut slopes) = (vec![[0.0; m::X]; u.len()], vec![[[0.0; m::U]; m::X]; u.len()]);
    let mut status = vec![9; u.len()];
    let found = m::transmission_batch(s, u, &mut x, &mut slopes, &mut status);
    assert_eq!(found, status.iter().filter(|&&k| k == m::CONVERGED).count());
    for k in 0..u.len() {{
        show(x[k], slopes[k], status[k]);
    }}
}}
fn show(x: [f64; m::X], slopes: [[f64; m::U]; m::X], status: usize) {{
    print!("{{}}", status);
    let tau = m::effort(&slopes, &[{text_of(tau)}]);
    for y in x.iter().chain(slopes.iter().flatten()).chain(tau.iter()) {{
        print!(" {{:?}}", y);
    }}
    println!();
}}
fn main() {{
{"".join(steps)}
}}
"""
    return [list(map(float, x.split())) for x in run_rust(folder, main)]


def in_octave(emitted, calls, tau, folder):
    """Call the Octave function."""
    name = f"{emitted.name}_transmission"
    lines = [f"tau = [{text_of(tau)}]';"]
    for kind, given in calls:
        if kind == "go":
            lines.append(f"[s, x, J, status] = {name}(s, [{text_of(given)}]);")
            lines.append("rows = J'; show('line', [status; x; rows(:); J' * tau]);")
            continue
        if kind == "path":
            columns = "; ".join(text_of(row) for row in zip(*given, strict=True))
            lines.append(f"[s, x, J, status] = {name}_batch(s, [{columns}]);")
            lines.append("for k = 1:numel(status)")
            lines.append("rows = J(:, :, k)';")
            lines.append("show('line', [status(k); x(:, k); rows(:); rows * tau]);")
            lines.append("end")
            continue
        own = [f"[{text_of(x)}]" for x in given]
        lines.append(f"[s, x, J, status] = {name}({', '.join(['[]', *own]) if own else ''});")
        lines.append("show('line', status);")
    return run_octave(folder, lines)["line"]


LANGUAGES = {
    "numpy": in_python,
    "c": in_c,
    "octave": in_octave,
    "javascript": in_javascript,
    "rust": in_rust,
}
MOST = 240  # points of a path
TOOLS = {"octave": OCTAVE, "javascript": NODE, "rust": RUSTC}


def inputs_of(calls):
    """Return the number of inputs."""
    given = next(given for kind, given in calls if kind != "start")
    return len(np.atleast_2d(given)[0])


def called(target, emitted, calls, tau, folder, compiler=None):
    """Return what each call gives; of a start its status."""
    if target in TOOLS and TOOLS[target] is None:
        pytest.skip(NEEDED["node" if target == "javascript" else target][1])
    emitted.write(folder)
    run = partial(in_c, compiler=compiler) if target == "c" else LANGUAGES[target]
    lines = run(emitted, calls, list(map(float, tau)), folder)
    m, n, given = len(tau), inputs_of(calls), iter(lines)
    found: list[Any] = []
    for kind, points in calls:
        if kind == "path":
            found.append([found_of(next(given), m, n) for _ in points])
        else:
            line = next(given)
            found.append(int(line[0]) if kind == "start" else found_of(line, m, n))
    assert next(given, None) is None
    return found
