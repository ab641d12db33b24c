/* ---- what the march says of points ---- */

/* A point; one that has `equations` is solved with pivoting. */
const spare = (p, equations = null) => Object.assign(point(p), { equations, dense: null, sensitivity: 0 });

function copy_state(to, from) {
    to.t = from.t;
    to.q.set(from.q);
    to.q_dot.set(from.q_dot);
    to.q_ddot.set(from.q_ddot);
    to.determinants.set(from.determinants);
}

function prepare(at) {
    factor_at(at);
    at.dense = null;
    if (at.equations) at.equations.factors(at);
}

function solve_into(at, right, to) {
    if (at.dense) to.set(solve(at.dense, independent(at.equations.model, right)));
    else solve_at(at.F, right, to);
}

/* Solve for velocity and acceleration at a position, with pivoting; returns its status. */
function completed(at, equations) {
    const found = new_outcome();
    at.equations = equations;
    complete(at, equations.scales, found);
    Object.assign(at, { equations: null, sensitivity: found.sensitivity });
    return found.status;
}

/* Follow the motion from a good point to a time, in sub-steps and with pivoting. `position` is the
   one found at that time, `state` the last point to go on from. */
function advance(equations, from, t) {
    const at = spare(equations.p), last = spare(equations.p, equations), found = new_outcome();
    copy_state(at, from);
    const isExhausted = !advance_carefully(last, equations.scales, at, from.sensitivity, t, found);
    const { status, iterations, sensitivity } = found, position = found.is_there ? last : null;
    Object.assign(last, { equations: null, sensitivity });
    position_at(at);
    return { status, iterations, isExhausted, state: status === CONVERGED ? last : at, position };
}

/* ---- the whole grid ---- */

/* The times at which the velocity of a driver jumps, as the runtime finds them. */
function cornersOf(model, times, p, guess) {
    if (!model.CORNERS) return times.map(() => 0);
    const reach = SAME_TIME * largest(times), most = new Float64Array(model.N_EQUATIONS);
    const jumps = Array.from(times, t => {
        const [before, after] = [-1, 1].map(side => model.nu(guess, t + side * reach, p));
        before.forEach((x, i) => { most[i] = Math.max(most[i], Math.abs(x) || 0, Math.abs(after[i]) || 0); });
        return before.map((x, i) => Math.abs(after[i] - x));
    });
    return times.map((_, k) => (jumps[k].some((x, i) => x > CORNER * most[i]) ? reach : 0));
}

/* The motion over times: arrays q, q_dot, q_ddot (a point after another, NaN where nothing was
   found) and y, y_dot, y_ddot of outputs, the status and the iterations of each point; whether the
   start `strays` from the branch of the guess, and the bodies that another start, as near to it,
   has elsewhere; and what `explain` needs: the problem, the failed point, what was found of it. */
function motionOver(model, times, p = model.DEFAULTS, guess = model.GUESS) {
    const n = model.N_COORDINATES, count = times.length, width = model.OUTPUTS.length;
    const array = size => new Float64Array(count * size).fill(NaN);
    const motion = {
        t: times, p, q: array(n), q_dot: array(n), q_ddot: array(n),
        y: array(width), y_dot: array(width), y_ddot: array(width), residual: array(1),
        status: new Int32Array(count).fill(NOT_REACHED), iterations: new Int32Array(count),
        failed: null, near: [], other: null, strays: false,
    };
    guess = Float64Array.from(guess);
    orient({ meant: guess });
    const corners = cornersOf(model, Float64Array.from(times), p, guess);
    const timeOf = k => times[k] + corners[k];
    let outcome = start(model, p, guess, timeOf(0));
    const { other = null, strays = false } = outcome;
    let equations = outcome.equations;
    Object.assign(motion, { equations, other, strays });
    record(motion, 0, outcome, model);
    motion.iterations[0] = outcome.iterations;
    const found = new_outcome();
    let from = outcome.state, to = spare(p);
    for (let k = 1; k < count && outcome.status === CONVERGED; k += 1) {
        const t = timeOf(k);
        copy_state(to, from);
        step(to, equations.scales, t, found);
        motion.iterations[k] = found.iterations;
        if (found.status === CONVERGED && found.sensitivity <= TOO_NEAR) {
            to.sensitivity = found.sensitivity;
            outcome = { status: CONVERGED, state: to, position: to };
            record(motion, k, outcome, model);
            [from, to] = [to, from];
            continue;
        }
        outcome = advance(equations, from, t);
        motion.iterations[k] += outcome.iterations;
        const fresh = isDoubtful(outcome) && measuredAgain(equations, from);
        if (fresh) {
            equations = motion.equations = fresh;
            outcome = advance(equations, from, t);
            motion.iterations[k] += outcome.iterations;
        }
        if (!outcome.position && !outcome.isExhausted) outcome = giveUp(equations, outcome, t);
        record(motion, k, outcome, model);
        // Rates near a singularity are too uncertain to predict from: the point before serves.
        if (outcome.state.sensitivity <= Math.max(TOO_NEAR, from.sensitivity)) {
            [from, to] = [outcome.state, spare(p)];
        }
    }
    if (outcome.status !== CONVERGED) {
        const index = motion.status.findIndex(status => status !== CONVERGED);
        motion.failed = { ...outcome, index, t: timeOf(index) };
    }
    for (let k = 0; k < count; k += 1) {
        if (!corners[k] || motion.status[k] !== CONVERGED) continue;
        motion.status[k] = AT_CORNER;
        motion.q_ddot.fill(NaN, k * n, (k + 1) * n);
    }
    return motion;
}

/* Whether a point was not reached, or is nearly singular, by the scales so far. */
function isDoubtful({ status, state, isExhausted }) {
    return !isExhausted && (status !== CONVERGED || state.sensitivity > TOO_NEAR);
}

/* The equations measured where the motion has come to, if they are others there: exp(-x) is not
   nearly singular at x = 20, it is small. */
function measuredAgain(equations, { q, t }) {
    const fresh = new Problem(equations.model, equations.p, q, t);
    const isOther = (now, i) => now < equations.magnitude[i] / OTHER_SIZE || now > equations.magnitude[i] * OTHER_SIZE;
    return fresh.magnitude.some(isOther) && fresh;
}

/* Assemble the mechanism at the first time. */
function start(model, p, guess, t) {
    const rough = new Problem(model, p, guess, t);
    const { status: found, iterations, is_crawling, last: at, other } = assembled(rough, t, guess);
    if (found !== CONVERGED) {
        const status = found === NOT_CONVERGED ? NOT_ASSEMBLED : found;
        return { status, iterations, equations: rough, state: null, position: null, nearest: at };
    }
    let status = completed(at, rough);
    // Towards a singular position Newton's method creeps, and ends a rounding error before it.
    if (status === CONVERGED && is_crawling && at.sensitivity > TOO_NEAR) status = SINGULAR;
    // The guess may be rough: from here on the assembled mechanism gives the size.
    const equations = new Problem(model, p, at.q, t);
    const elsewhere = other?.map((x, k) => (x - at.q[k]) / rough.reference[k]);
    rough.meant.set(guess);
    return {
        status, iterations, equations, state: status === CONVERGED ? at : null, position: at,
        other: elsewhere ? involved(model, elsewhere) : null,
        strays: leaves_branch(at.q, point(p), rough),
    };
}

/* Look for a position at a time that the motion does not reach. */
function giveUp(equations, outcome, t) {
    const attempt = assembled(equations, t, outcome.state.q);
    const jumps = attempt.status === CONVERGED;
    return { ...outcome, status: jumps ? outcome.status : attempt.status, nearest: attempt.last, jumps };
}

function record(motion, k, { status, state, position, nearest, jumps }, model) {
    const n = model.N_COORDINATES, width = model.OUTPUTS.length;
    motion.status[k] = status;
    const known = position || (jumps ? null : nearest);
    if (known) motion.residual[k] = largest(known.Phi);
    if (!position) return;
    motion.q.set(position.q, k * n);
    if (status !== CONVERGED) return;
    motion.q_dot.set(state.q_dot, k * n);
    motion.q_ddot.set(state.q_ddot, k * n);
    if (state.sensitivity > TOO_NEAR) motion.near.push(k);
    if (!width) return;
    model.observe_at(state);
    motion.y.set(state.outputs, k * width);
    motion.y_dot.set(state.outputs_dot, k * width);
    motion.y_ddot.set(state.outputs_ddot, k * width);
}

/* The motion at any time between its points, followed from the nearest of them: a point with
   outputs, or null where it cannot be followed. */
function between(motion, t) {
    const { equations, t: times, q, status } = motion, { n, model } = equations;
    const order = [...times.keys()].sort((a, b) => Math.abs(times[a] - t) - Math.abs(times[b] - t));
    for (const k of order.slice(0, 2).filter(place => status[place] === CONVERGED)) {
        const from = equations.evaluate(q.subarray(k * n, (k + 1) * n), times[k]);
        if (completed(from, equations) !== CONVERGED) continue;
        const { state, position } = advance(equations, from, t);
        if (!position) continue;
        if (model.OUTPUTS.length) model.observe_at(state);
        return state;
    }
    return null;
}
