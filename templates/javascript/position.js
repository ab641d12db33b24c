/* ---- the size of the mechanism, and by what its positions are judged ---- */

/* A scale with 24 bits: with rounding errors of its own, all targets judge by the same numbers. */
function rounded(x) {
    const near = Math.fround(x);
    return Math.abs(near - x) <= 2 ** -24 * Math.abs(x) ? near : x;
}

/* The size of a mechanism as its equations show it at a guess or a position: the largest lever
   arm, else the distance over which derivatives change; 0 where equations are linear. */
function sizeOf(evaluate, q) {
    const finite = values => largest(values.filter(Number.isFinite));
    const ofRows = (entries, isWanted) => {
        const most = new Float64Array(M);
        PATTERN.forEach(([i, j], k) => {
            if (isWanted(j) && !(most[i] >= Math.abs(entries[k]))) most[i] = Math.abs(entries[k]);
        });
        return most;
    };
    const moved = (from, kind, length) => from.map((x, k) => x + (ANGULAR[k] === kind ? length * PROBE[k] : 0));
    const { Phi_q } = evaluate(moved(q, true, 1));
    const slopes = ofRows(Phi_q, j => !ANGULAR[j]), arms = ofRows(Phi_q, j => ANGULAR[j]);
    const size = finite(arms.map((arm, i) => arm / slopes[i]).filter((_, i) => slopes[i] > 0));
    if (size) return size;
    const farthest = finite(q.filter((_, k) => !ANGULAR[k])) || 1;
    const step = SMALL_PART * farthest;
    const length = step * finite(q.map((_, k) => (ANGULAR[k] ? 0 : PROBE[k])));
    const bends = from => {
        const here = evaluate(from), there = evaluate(moved(from, false, step));
        const change = ofRows(here.Phi_q.map((x, k) => (there.Phi_q[k] - x) / length), () => true);
        const own = ofRows(here.Phi_q, () => true);
        const rows = [...own.keys()].filter(i => change[i] * length > CONSTANT * own[i]);
        return rows.map(i => Math.max(own[i] / change[i], Math.sqrt(Math.abs(here.Phi[i]) / change[i])));
    };
    const near = bends(q);
    if (!near.length) return 0;
    let found = Math.min(Infinity, ...near.filter(bend => bend > 10 * step));
    if (found < Infinity) {
        const known = bends(moved(q, false, found)).filter(bend => bend > 0 && bend < Infinity);
        found = known.length ? known.length / known.reduce((sum, bend) => sum + 1 / bend, 0) : 0;
    }
    return found > 10 * step && found < Infinity ? found : farthest;
}

/* A mechanism with its parameters, and the scales by which all is judged, found at q; `met` are
   assemblies that a start has met, `points` those of a run, where they are wanted. */
class Problem {
    constructor(model, p, q, t) {
        Object.assign(this, new_start(), { model, p, t, n: N, tolerance: TOLERANCE, met: [], points: null });
        this.size = rounded(sizeOf(x => this.evaluate(x, t), Array.from(q))) || 1;
        judge_around(q, this.size, point(p), this);
        this.scales = this.scalesAt(q, t);
    }

    /* By what the march judges points: where a generic position has no values, by what is at q. */
    scalesAt(q, t) {
        const { reference, place, floor } = this, inverse = reference.map(x => 1 / x);
        let { magnitude, noise } = this;
        if (!magnitude.some(x => x > 0)) {
            const at = this.evaluate(q, t);
            noise = this.termsAt(at, reference.map((x, k) => x + place[k])).map(x => ROUNDING * x);
            magnitude = this.termsAt(at, reference).map(rounded);
        }
        // By what part of their terms equations of rates may be missed.
        const part = IS_REDUNDANT.map(repeats => (repeats ? AGREEMENT : SOLVED));
        const here = magnitude.slice(), tolerance = Math.max(TOLERANCE, floor);
        return { reference, inverse, magnitude, noise, here, part, tolerance };
    }

    /* A point with Phi and Phi_q. */
    evaluate(q, t) {
        const at = this.model.point(this.p);
        at.q.set(q);
        at.t = t;
        this.model.position_at(at);
        return at;
    }

    /* The factors of the dense matrix at a point, kept with it. */
    factors(at) {
        at.dense ??= factor(independent(this.model, this.model.rows_of(at, "Phi_q")));
        return at.dense;
    }

    determinants(at) {
        this.model.factor_at(at);
        return at.determinants;
    }

    weights(terms = this.magnitude) {
        return terms.map(x => 1 / (x > 0 ? x : 1));
    }

    /* What the terms of each equation contribute at scales of the coordinates. */
    termsAt(at, scale) {
        find_terms(scale, at, this);
        return this.terms.slice();
    }
}

/* ---- what is kept of a start ---- */

function noted_step(q, b, equations) {
    equations.points?.push(q.slice());
    return plain_step(q, b, equations);
}

function take_and_note(b, equations, attempt, other, best) {
    take(b, equations, attempt, other, best);
    equations.met.push({ ...attempt, q: attempt.q.slice() });
}

/* A position from a guess and how it was found; `other` is another one that is as near to it. */
function assembled(equations, t, guess) {
    const best = new_attempt();
    Object.assign(equations, { t, met: [] });
    find_position(guess, MAX_ITERATIONS, point(equations.p), equations, best);
    return { ...best, last: equations.evaluate(best.q, t), other: asNear(equations, best.q) };
}

function asNear(equations, q) {
    const { met, meant, reference, way } = equations, reach = AS_NEAR * away_from(q, meant, equations);
    const isOther = other => {
        if (!(away_from(other.q, meant, equations) <= reach)) return false;
        find_way(other.q, q, equations);
        return way.some((x, k) => Math.abs(x) > SAME_POSITION * reference[k]);
    };
    met.sort((a, b) => a.away - b.away || a.rank - b.rank || a.far - b.far);
    return met.find(isOther)?.q ?? null;
}

/* All positions of plain Newton from a guess, and how it ends. */
function iterates(equations, t, guess) {
    const run = new_attempt(), points = [];
    Object.assign(equations, { t, points });
    iterate(guess, false, MAX_ITERATIONS, point(equations.p), equations, run);
    equations.points = null;
    if (points.length <= run.iterations) points.push(run.q);
    return { status: run.status, points: points.map(q => equations.evaluate(q, t)) };
}
