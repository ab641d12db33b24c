/* ---- from time to time ---- */

/* Takes a motion from time to time. With `isDense` the matrices are solved with pivoting. */
class March {
    constructor(equations) {
        Object.assign(this, { equations, model: equations.model, isDense: false, iterations: 0 });
        this.tolerance = Math.max(TOLERANCE, equations.floor);
        this.residual = Math.max(ASSEMBLED, ROUNDING);
        const vector = () => new Float64Array(equations.n);
        [this.change, this.predicted, this.rounding, this.expected] = [vector(), vector(), vector(), vector()];
        this.missing = new Float64Array(equations.m);
        this.sides = equations.magnitude.map((x, i) => x * equations.probe[i]);
    }

    prepare(at) {
        this.model.factor_at(at);
        at.dense = null;
        if (this.isDense) this.equations.factors(at);
    }

    solve(at, right, to) {
        if (this.isDense) to.set(solve(at.dense, independent(this.model, right)));
        else this.model.solve_at(at.F, right, to);
    }

    /* Newton's method from a prediction; says whether it converged. */
    correct(at, most) {
        const { model, equations, change, rounding } = this, { n, reference } = equations;
        for (let k = 0; k < n; k += 1) rounding[k] = ROUNDING * Math.abs(at.q[k]);
        let last = Infinity;
        model.position_at(at);
        for (let iteration = 0; iteration < most; iteration += 1) {
            this.iterations += 1;
            this.prepare(at);
            this.solve(at, at.Phi, change);
            let size = -Infinity;
            for (let k = 0; k < n; k += 1) {
                at.q[k] -= change[k];
                const part = (Math.abs(change[k]) - rounding[k]) / reference[k];
                if (!(part <= size)) size = part;
            }
            model.position_at(at);
            // Near a singular position rounding alone keeps the corrections above any bound.
            if (size <= this.tolerance || !(size <= last / 4)) {
                const isDone = (size <= this.tolerance && equations.holds(at, this.residual)) || equations.holdsToRounding(at);
                if (isDone || !(size < Infinity)) return isDone;
            }
            last = size;
        }
        return false;
    }

    /* Solve for velocity and acceleration; a third right side, of the size of the equations' own
       terms, shows how near to singular Phi_q is. */
    complete(at) {
        const { model, change, equations } = this;
        this.prepare(at);
        this.solve(at, this.sides, change);
        model.nu_at(at);
        this.solve(at, at.nu, at.q_dot);
        model.gamma_at(at);
        this.solve(at, at.gamma, at.q_ddot);
        at.sensitivity = 0;
        let sum = 0;
        for (let k = 0; k < equations.n; k += 1) {
            const size = Math.abs(change[k]) / equations.reference[k];
            if (!(size <= at.sensitivity)) at.sensitivity = size;
            sum += at.q_dot[k] + at.q_ddot[k];
        }
        if (!(at.sensitivity < SINGULAR_SENSITIVITY)) return whySingular(at);
        if (!Number.isFinite(sum)) return NOT_FINITE;
        return this.areMet(at) ? CONVERGED : SINGULAR;
    }

    /* Whether velocity and acceleration meet Phi_q x = b: elimination with pivots chosen beforehand may
       lose all digits. Accelerations are measured by the square of the velocities too, which gamma
       is made of. */
    areMet(at) {
        const { equations } = this, { PATTERN } = equations.model, { m, none } = equations;
        const terms = equations.terms(at, equations.reference), missing = this.missing;
        const speed = equations.distance(at.q_dot, none), growth = equations.distance(at.q_ddot, none) + speed * speed;
        for (const [x, b, size] of [[at.q_dot, at.nu, speed], [at.q_ddot, at.gamma, growth]]) {
            for (let i = 0; i < m; i += 1) missing[i] = -b[i];
            for (let k = 0; k < PATTERN.length; k += 1) missing[PATTERN[k][0]] += at.Phi_q[k] * x[PATTERN[k][1]];
            for (let i = 0; i < m; i += 1) {
                if (!(Math.abs(missing[i]) <= equations.parts[i] * terms[i] * size)) return false;
            }
        }
        return true;
    }

    /* Take a step from a good point: `to` counts only where it continues the motion. `to.isThere`
       says whether it is a position of the motion at that time. */
    step(from, to, t, most) {
        const { equations, predicted } = this, { n, reference } = equations, h = t - from.t;
        for (let k = 0; k < n; k += 1) {
            predicted[k] = from.q[k] + h * (from.q_dot[k] + h / 2 * from.q_ddot[k]);
        }
        to.q.set(predicted);
        to.t = t;
        to.isThere = false;
        const isGood = this.correct(to, most);
        const error = equations.distance(to.q, predicted), movement = equations.distance(predicted, from.q);
        if (!isGood || !(error <= Math.min(LARGE_ERROR, Math.max(SMALL_ERROR, ALLOWED_PART * movement)))) return NOT_CONVERGED;
        const status = this.complete(to);
        to.isThere = status !== CONVERGED;
        if (status !== CONVERGED) return status;
        for (let k = 0; k < from.determinants.length; k += 1) {
            if (Math.sign(from.determinants[k]) !== Math.sign(to.determinants[k])) return SINGULAR;
        }
        let kink = 0;
        for (let k = 0; k < n; k += 1) {
            const turn = Math.abs(h * (to.q_dot[k] - from.q_dot[k] - h * from.q_ddot[k])) / reference[k];
            if (!(turn <= kink)) kink = turn;
        }
        if (!(to.sensitivity <= NEARLY_SINGULAR || kink <= KINK * error + SMOOTH)) return SINGULAR;
        to.isThere = true;
        return CONVERGED;
    }

    /* The time in which something moves as far as its scale. */
    timeOf({ q_dot, q_ddot }) {
        const part = (vector) => largest(vector.map((x, k) => x / this.equations.reference[k]));
        return 1 / Math.max(part(q_dot), Math.sqrt(part(q_ddot)), 1e-300);
    }

    /* Follow the motion from a good point to a time, in sub-steps that are halved where they fail
       and doubled where they do not. */
    advance(from, t, most = MAX_ITERATIONS) {
        const spare = () => this.model.point(this.equations.p);
        let h = t - from.t, state = from, to = spare(), status = NOT_CONVERGED, wait = 0;
        const smallest = Math.min(Math.abs(h), this.timeOf(from)) * SMALLEST_PART;
        for (let count = 0; count < MAX_SUBSTEPS; count += 1) {
            const isWhole = Math.abs(h) >= Math.abs(t - state.t);
            status = this.step(state, to, isWhole ? t : state.t + h, most);
            const isGood = status === CONVERGED;
            const isNear = isGood && to.sensitivity > Math.max(TOO_NEAR, state.sensitivity);
            if (isNear && !isWhole) status = SINGULAR;
            if (isWhole && to.isThere) return { status, state: isGood ? to : state, position: to };
            if (isGood && !isNear) {
                // After a step that was too long the next ones are no longer.
                [state, to, wait] = [to, spare(), Math.max(wait - 1, 0)];
                if (!wait || Math.abs(2 * h) >= Math.abs(t - state.t)) h *= 2;
            } else if (Math.abs(h) <= smallest) {
                return { status, state, position: null };
            } else {
                [h, wait] = [h / 2, PATIENCE];
            }
        }
        return { status: NOT_CONVERGED, state, position: null, isExhausted: true };
    }
}

/* ---- the whole grid ---- */

/* A guess with Euler parameters of a length near one: any length is an orientation. By their largest
   first, since the squares of large ones overflow. */
function oriented(model, guess) {
    const q = Float64Array.from(guess);
    for (const [, first] of model.BODIES.filter(body => body[2] === SPATIAL_COORDINATES)) {
        const p = q.subarray(first + 3, first + 7), most = Math.max(...p.map(Math.abs));
        const rest = Math.sqrt(p.reduce((sum, x) => sum + (x / most) ** 2, 0)), length = most * rest;
        if (length > LONGEST_P || length < 1 / LONGEST_P) p.forEach((x, k) => { p[k] = x / most / rest; });
    }
    return q;
}

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
    guess = oriented(model, guess);
    const corners = cornersOf(model, Float64Array.from(times), p, guess);
    const timeOf = k => times[k] + corners[k];
    let outcome = start(model, p, guess, timeOf(0));
    const { equations, other = null, strays = false } = outcome;
    let march = new March(equations);
    Object.assign(motion, { equations, other, strays });
    record(motion, 0, outcome, model);
    motion.iterations[0] = outcome.iterations;
    let from = outcome.state, to = model.point(p);
    for (let k = 1; k < count && outcome.status === CONVERGED; k += 1) {
        Object.assign(march, { isDense: false, iterations: 0 });
        const status = march.step(from, to, timeOf(k), MAX_CORRECTIONS);
        if (status === CONVERGED && to.sensitivity <= TOO_NEAR) {
            outcome = { status, state: to, position: to };
            record(motion, k, outcome, model);
            motion.iterations[k] = march.iterations;
            [from, to] = [to, from];
            continue;
        }
        march.isDense = true;
        outcome = march.advance(from, timeOf(k));
        const fresh = isDoubtful(outcome) && measuredAgain(march, from);
        if (fresh) {
            [march, motion.equations] = [fresh, fresh.equations];
            outcome = march.advance(from, timeOf(k));
        }
        motion.iterations[k] = march.iterations;
        if (!outcome.position && !outcome.isExhausted) outcome = giveUp(motion.equations, outcome, timeOf(k));
        record(motion, k, outcome, model);
        // Rates near a singularity are too uncertain to predict from: the point before serves.
        if (outcome.state.sensitivity <= Math.max(TOO_NEAR, from.sensitivity)) {
            [from, to] = [outcome.state, model.point(p)];
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

/* The march by the equations measured where the motion has come to, if they are others there: exp(-x)
   is not nearly singular at x = 20, it is small. */
function measuredAgain({ equations, iterations }, { q, t }) {
    const fresh = new Problem(equations.model, equations.p, q, t);
    const isOther = (now, i) => now < equations.magnitude[i] / OTHER_SIZE || now > equations.magnitude[i] * OTHER_SIZE;
    return fresh.magnitude.some(isOther) && Object.assign(new March(fresh), { isDense: true, iterations });
}

/* Assemble the mechanism at the first time. */
function start(model, p, guess, t) {
    const rough = new Problem(model, p, guess, t);
    const attempt = assemble(rough, t, Float64Array.from(guess)), iterations = attempt.corrections.length;
    if (attempt.status !== CONVERGED) {
        const status = attempt.status === NOT_CONVERGED ? NOT_ASSEMBLED : attempt.status;
        return { status, iterations, equations: rough, state: null, position: null, nearest: attempt.last };
    }
    const march = new March(rough), at = attempt.last;
    march.isDense = true;
    let status = march.complete(at);
    // Towards a singular position Newton's method creeps, and ends a rounding error before it.
    if (status === CONVERGED && crawls(attempt.corrections) && at.sensitivity > TOO_NEAR) status = SINGULAR;
    // The guess may be rough: from here on the assembled mechanism gives the size.
    const equations = new Problem(model, p, at.q, t);
    const elsewhere = attempt.other?.q.map((x, k) => (x - at.q[k]) / rough.reference[k]);
    return {
        status, iterations, equations, state: status === CONVERGED ? at : null, position: at,
        other: elsewhere ? involved(model, elsewhere) : null,
        strays: rough.leavesBranch(rough.evaluate(guess, t), at),
    };
}

/* What is there at a time that the motion does not reach. */
function giveUp(equations, outcome, t) {
    const attempt = assemble(equations, t, outcome.state.q);
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
        const march = new March(equations), from = equations.evaluate(q.subarray(k * n, (k + 1) * n), times[k]);
        march.isDense = true;
        if (march.complete(from) !== CONVERGED) continue;
        const { state, position } = march.advance(from, t, MAX_CORRECTIONS);
        if (!position) continue;
        if (model.OUTPUTS.length) model.observe_at(state);
        return state;
    }
    return null;
}
