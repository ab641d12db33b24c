/* ---- what ends a motion ---- */

/* The curve of solutions in q and t together, followed by its arc length: where it turns back in
   time there is a lock-up, where a determinant changes its sign on the way a bifurcation. */
class Curve {
    constructor(equations, state, time) {
        this.equations = equations;
        this.scale = [...equations.reference, time];
        this.weights = equations.weights(equations.termsAt(state, equations.reference));
    }

    /* A point of the motion as one of the curve, looking forward or back in time. */
    start(state, direction) {
        const towards = [...state.q_dot, 1].map((x, k) => direction * x / this.scale[k]);
        return this.place(Array.from(state.q), state.t, towards);
    }

    /* The equations and their scaled derivatives by q and t; null where they are not finite. */
    derivatives(q, t) {
        const at = this.equations.evaluate(q, t), { model } = this.equations;
        model.nu_at(at);
        const matrix = model.rows_of(at, "Phi_q").map((row, i) => {
            return [...row, -at.nu[i]].map((x, k) => this.weights[i] * x * this.scale[k]);
        });
        return allFinite(at.Phi) && matrix.every(allFinite) ? { at, matrix } : null;
    }

    place(q, t, towards) {
        const found = this.derivatives(q, t);
        return found && { q, t, ...found, tangent: tangentOf(found.matrix, towards) };
    }

    /* Go a length along the curve; null where it cannot be followed so far. */
    step(from, length) {
        const { scale, weights } = this, n = from.q.length;
        let y = [...from.q, from.t].map((x, k) => x + length * from.tangent[k] * scale[k]);
        const predicted = y;
        const scaled = () => y.map((x, k) => (x - predicted[k]) / scale[k]);
        let last = Infinity, isDone = false;
        for (let k = 0; k < ARC_CORRECTIONS && !isDone; k += 1) {
            const found = this.derivatives(y.slice(0, n), y[n]);
            if (!found) return null;
            const away = scaled().reduce((sum, x, j) => sum + x * from.tangent[j], 0);
            const right = [...found.at.Phi.map((x, i) => weights[i] * x), away];
            const change = solve(factor([...found.matrix, from.tangent]), right);
            if (!allFinite(change)) return null;
            y = y.map((x, j) => x - change[j] * scale[j]);
            const size = largest(change);
            isDone = size <= SMALL_CORRECTION || (size <= TOLERABLE_CORRECTION && size > last / 4);
            last = size;
        }
        if (!isDone || !(norm(scaled()) <= Math.max(Math.abs(length) / 4, TOLERABLE_CORRECTION))) return null;
        return this.place(y.slice(0, n), y[n], from.tangent);
    }

    /* Follow the curve up to a time, or to the first step that contains a singular point. */
    nextSingular(place, latest) {
        const forward = Math.sign(latest - place.t) || 1, n = place.q.length;
        for (let count = 0, length = FIRST_ARC; count < MAX_ARCS; count += 1) {
            const following = this.step(place, length);
            const turned = following && following.tangent.reduce((sum, x, k) => sum + x * place.tangent[k], 0);
            if (!following || turned < STRAIGHT) {
                length /= 2;
                if (length < SHORTEST_ARC) return null;
                continue;
            }
            const turns = following.tangent[n] * place.tangent[n] <= 0;
            const blocks = this.changed(place, following);
            if (turns || blocks.length) return { first: place, length, turns, blocks };
            if ((following.t - latest) * forward > 0) return null;
            place = following;
            length = Math.min(2 * length, LONGEST_ARC);
        }
        return null;
    }

    /* The determinants of blocks, as parts of what they were. */
    parts(before, after) {
        const [there, here] = [before, after].map(({ at }) => this.equations.determinants(at));
        return Array.from(here, (x, k) => x / there[k]);
    }

    changed(before, after) {
        return [...this.parts(before, after).entries()].filter(([, part]) => !(part > 0)).map(([k]) => k);
    }

    /* The singular configuration in a bracket. */
    singularPoint({ first, length, turns, blocks }) {
        const n = first.q.length, along = part => (part ? this.step(first, part) : first);
        if (turns) {
            const at = rootOf(part => along(part)?.tangent[n] ?? null, length);
            // Where several movements become free at once no step ends; beside it t is the same.
            for (const offset of BESIDE) {
                const place = this.step(first, at + offset);
                if (place) return place;
            }
            return null;
        }
        const least = part => {
            const place = along(part);
            return place && Math.min(...this.parts(first, place).filter((_, k) => blocks.includes(k)));
        };
        const at = rootOf(least, length), before = this.step(first, at - AROUND);
        const parts = before ? this.parts(first, before) : null;
        const block = parts ? blocks.reduce((best, k) => (parts[k] < parts[best] ? k : best)) : blocks[0];
        return this.between(first, at, block);
    }

    /* A bifurcation by interpolation of places so far from it that they are accurate. */
    between(first, at, block) {
        const places = AROUND_OFFSETS.map(offset => this.step(first, at + offset * AROUND));
        if (!places.every(Boolean)) return null;
        const powers = factor(AROUND_OFFSETS.map(x => [1, x, x * x, x * x * x]));
        const cubic = values => solve(powers, values);
        const value = cubic(places.map(({ at: point }) => this.equations.determinants(point)[block]));
        let x = 0;
        for (let k = 0; k < ROOT_STEPS; k += 1) {
            const slope = value[1] + x * (2 * value[2] + 3 * x * value[3]);
            x -= (value[0] + x * (value[1] + x * (value[2] + x * value[3]))) / (slope || Infinity);
        }
        if (!(Math.abs(x) < 2)) x = 0;
        const y = [...first.q, 0].map((_, k) => {
            const c = cubic(places.map(({ q, t }) => (k < q.length ? q[k] : t)));
            return c[0] + x * (c[1] + x * (c[2] + x * c[3]));
        });
        return this.place(y.slice(0, -1), y[y.length - 1], first.tangent);
    }
}

/* The unit vector that a matrix takes to zero, in a direction. */
function tangentOf(matrix, towards) {
    const along = matrix.map(() => 0);
    let tangent = solve(factor([...matrix, towards]), [...along, 1]);
    if (!allFinite(tangent)) {
        tangent = singularValues(matrix)[0].direction;
        if (tangent.reduce((sum, x, k) => sum + x * towards[k], 0) < 0) tangent = tangent.map(x => -x);
    }
    const size = norm(tangent);
    return tangent.map(x => x / size);
}

/* A zero in (0, length) of a function that changes its sign there: regula falsi with the weights
   of the Illinois method, a bisection every third step. */
function rootOf(value, length) {
    let low = 0, high = length, atLow = value(low), atHigh = value(high);
    if (atLow === null || atHigh === null || atLow === 0 || atHigh === 0) return atLow === 0 ? low : high;
    for (let k = 0; k < ROOT_STEPS; k += 1) {
        let middle = (low + high) / 2;
        if (k % 3 < 2 && atHigh !== atLow) middle = (low * atHigh - high * atLow) / (atHigh - atLow);
        const here = value(middle);
        if (here === null || here === 0 || high - low <= ROOT_LENGTH) return middle;
        if (here * atLow > 0) [low, atLow, atHigh] = [middle, here, atHigh / 2];
        else [high, atHigh, atLow] = [middle, here, atLow / 2];
    }
    return (low + high) / 2;
}

/* The rows of Phi_q in scales of equations and coordinates. */
function scaledRows(equations, at, scale = equations.reference) {
    const weights = equations.weights();
    return equations.model.rows_of(at, "Phi_q").map((row, i) => {
        return row.map((x, k) => weights[i] * x * scale[k]);
    });
}

/* The bodies that take part in a movement, and coordinates that belong to none. */
function involved({ COORDINATES, BODIES }, movement) {
    const most = largest(movement);
    const ownerOf = k => BODIES.find(([, first, count]) => k >= first && k < first + count)?.[0] ?? COORDINATES[k];
    const large = [...COORDINATES.keys()].filter(k => Math.abs(movement[k]) > INVOLVED * most);
    return [...new Set(large.map(ownerOf))];
}

/* An event: what happens, when, where, and to which bodies. */
function eventAt(equations, kind, q, t, at) {
    const values = singularValues(scaledRows(equations, at)), most = values[values.length - 1].size;
    // Equal loops become singular together: then several movements are free.
    const free = values.filter(({ size }, k) => k === 0 || size <= IN_RANGE * most);
    const movement = Array.from(q, (_, k) => norm(free.map(({ direction }) => direction[k])));
    return { kind, t, q: Array.from(q), bodies: involved(equations.model, movement) };
}

/* The singular configuration that a motion cannot pass on its way to a time; null where the curve
   goes on to that time, or nowhere. */
function located(equations, state, latest) {
    const speed = largest(state.q_dot.map((x, k) => x / equations.reference[k]));
    const curve = new Curve(equations, state, speed > 0 ? 1 / speed : Math.abs(latest - state.t));
    const forward = Math.sign(latest - state.t) || 1, first = curve.start(state, forward);
    const bracket = first && curve.nextSingular(first, latest + LATE * (latest - state.t));
    const place = bracket && curve.singularPoint(bracket);
    if (!place || (place.t - latest) * forward > LATE * Math.abs(latest - state.t)) return null;
    return eventAt(equations, bracket.turns ? "lock-up" : "bifurcation", place.q, place.t, place.at);
}

/* What a position is from which no motion is known. */
function singularStart(equations, at) {
    const { model } = equations;
    model.nu_at(at);
    const rows = scaledRows(equations, at), weights = equations.weights();
    if (!allFinite(at.nu) || !rows.every(allFinite)) return null;
    const right = at.nu.map((x, i) => weights[i] * x);
    // Directions on the left are those on the right of the transposed matrix.
    const values = singularValues(rows[0].map((_, j) => rows.map(row => row[j])));
    const most = values[values.length - 1].size;
    const missing = values.filter(({ size }) => size <= IN_RANGE * most)
        .map(({ direction }) => direction.reduce((sum, x, i) => sum + x * right[i], 0));
    const kind = norm(missing) > IN_RANGE * norm(right) ? "lock-up" : "bifurcation";
    return eventAt(equations, kind, at.q, at.t, at);
}

/* The event that ended a motion; null if it did not end, or for a reason unknown. The failed point
   gets its status: how Newton's method fails there rounding decides. */
function explain(motion) {
    const { failed, status } = motion, event = failed && !failed.isExhausted ? endOf(motion) : null;
    if (!event || failed.position || failed.status === NOT_FINITE) return event;
    const isThere = Math.abs(event.t - failed.t) <= AT_EVENT * Math.max(Math.abs(event.t), Math.abs(failed.t));
    const reached = event.kind === "lock-up" && !isThere ? LOCK_UP : SINGULAR;
    status[failed.index] = failed.status = event.kind === "branch switch" ? NOT_CONVERGED : reached;
    return event;
}

function endOf(motion) {
    const { equations, failed } = motion, { state, position, nearest, jumps, status } = failed;
    if (!state) return status === SINGULAR && position ? singularStart(equations, position) : null;
    const found = located(equations, state, failed.t) || locatedFromPoint(motion);
    if (found || !jumps) return found;
    const jump = nearest.q.map((x, k) => (x - state.q[k]) / equations.reference[k]);
    const bodies = involved(equations.model, jump);
    return { kind: "branch switch", t: state.t, q: Array.from(nearest.q), bodies };
}

/* The event after the last of the times that was reached: a rounding error before it a state is
   too near to say what it is. */
function locatedFromPoint({ equations, failed, q, t }) {
    const k = failed.index - 1, { n } = equations;
    if (k < 0) return null;
    const at = equations.evaluate(q.subarray(k * n, (k + 1) * n), t[k]);
    return completed(at, equations) === CONVERGED ? located(equations, at, failed.t) : null;
}
