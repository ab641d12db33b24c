/* ---- scales: the size of the mechanism, and what the terms of its equations contribute ---- */

/* Numbers of size 1/2 to 1 and either sign without a pattern. */
function probeOf(n) {
    return Float64Array.from({ length: n }, (_, k) => {
        const part = (k + 1) * ((Math.sqrt(5) - 1) / 2) % 1;
        return (part * 64 % 2 < 1 ? 1 : -1) * (1 + part) / 2;
    });
}

/* A scale with 24 bits: with rounding errors of its own, all targets judge by the same numbers. */
function rounded(x) {
    const near = Math.fround(x);
    return Math.abs(near - x) <= 2 ** -24 * Math.abs(x) ? near : x;
}

/* The size of a mechanism as its equations show it at a guess or a position: the largest lever
   arm, else the distance over which derivatives change; 0 where equations are linear. */
function sizeOf(model, angular, evaluate, q) {
    const finite = values => largest(values.filter(Number.isFinite));
    const ofRows = (entries, isWanted) => {
        const most = new Float64Array(model.N_EQUATIONS);
        model.PATTERN.forEach(([i, j], k) => {
            if (isWanted(j) && !(most[i] >= Math.abs(entries[k]))) most[i] = Math.abs(entries[k]);
        });
        return most;
    };
    const probe = probeOf(q.length);
    const moved = (from, kind, length) => from.map((x, k) => x + (angular[k] === kind ? length * probe[k] : 0));
    const { Phi_q } = evaluate(moved(q, true, 1));
    const slopes = ofRows(Phi_q, j => !angular[j]), arms = ofRows(Phi_q, j => angular[j]);
    const size = finite(arms.map((arm, i) => arm / slopes[i]).filter((_, i) => slopes[i] > 0));
    if (size) return size;
    const farthest = finite(q.filter((_, k) => !angular[k])) || 1;
    const step = SMALL_PART * farthest;
    const length = step * finite(probe.filter((_, k) => !angular[k]));
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

/* A mechanism with its parameters, and the scales by which all is judged, found at q. */
class Problem {
    constructor(model, p, q, t) {
        const { N_COORDINATES: n, N_EQUATIONS: m } = model;
        Object.assign(this, { model, p, n, m });
        // Euler parameters, the last of a body in space, are cosines and sines of half angles.
        const ofEuler = ([, first, count], k) => count === SPATIAL_COORDINATES && k >= first + 3 && k < first + count;
        const isAngle = name => model.UNITS[name] === "rad";
        this.angular = model.COORDINATES.map((name, k) => isAngle(name) || model.BODIES.some(body => ofEuler(body, k)));
        this.covers = model.BODIES.filter(body => body[2] === SPATIAL_COORDINATES).map(([, first]) => {
            return [3, 4, 5, 6].map(k => first + k);
        });
        const isOwned = k => model.BODIES.some(([, first, count]) => k >= first && k < first + count);
        this.mayTurn = model.COORDINATES.map((name, k) => {
            return isAngle(name) || (model.UNITS[name] === "" && !isOwned(k));
        });
        this.size = rounded(sizeOf(model, this.angular, x => this.evaluate(x, t), Array.from(q))) || 1;
        this.reference = Float64Array.from(this.angular, isAngle => (isAngle ? 1 : this.size));
        // How far each coordinate of a guess may be from an assembly that it is near.
        this.near = this.reference.map((x, k) => x * (this.angular[k] ? NEAR_ANGLE : NEAR_PART));
        this.place = this.reference.map((x, k) => Math.min(Math.abs(q[k]), FARTHEST * x));
        this.floor = ROUNDING * largest(this.place.filter((_, k) => !this.angular[k])) / this.size;
        this.probe = probeOf(m);
        this.magnitude = new Float64Array(m);
        this.noise = new Float64Array(m);
        this.limit = new Float64Array(m).fill(Infinity);
        this.sums = new Float64Array(m);
        const generic = this.evaluate(this.place.map((_, k) => q[k] + this.reference[k] * this.probe[k]), t);
        const isKnown = allFinite(generic.Phi) && allFinite(generic.Phi_q);
        const measured = isKnown ? generic : this.evaluate(q, t);
        const own = this.terms(measured, this.reference).map(rounded);
        const here = this.terms(measured, this.reference.map((x, k) => x + this.place[k])).slice();
        this.scales = this.scalesOf(own, here.map(x => ROUNDING * x));
        if (!isKnown) return;
        this.magnitude = own;
        this.noise = this.scales.noise;
        this.limit = here.map(x => (x > 0 ? STEEP * x : Infinity));
    }

    /* By what the march judges points. */
    scalesOf(magnitude, noise) {
        const { model, reference, floor } = this, redundant = model.REDUNDANT ?? [];
        // By what part of their terms equations of rates may be missed.
        const part = model.EQUATIONS.map(name => (redundant.includes(name) ? AGREEMENT : SOLVED));
        const here = magnitude.slice(), inverse = reference.map(x => 1 / x);
        return { reference, inverse, magnitude, noise, here, part, tolerance: Math.max(TOLERANCE, floor) };
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
    terms(at, scale) {
        const { sums, magnitude, limit } = this, { PATTERN } = this.model;
        sums.fill(0);
        for (let k = 0; k < PATTERN.length; k += 1) {
            sums[PATTERN[k][0]] += Math.abs(at.Phi_q[k]) * scale[PATTERN[k][1]];
        }
        for (let i = 0; i < this.m; i += 1) {
            sums[i] = Math.max(magnitude[i], Math.min(sums[i], limit[i]));
        }
        return sums;
    }

    holds(at, tolerance) {
        const { magnitude, noise } = this;
        if (at.Phi.every((value, i) => Math.abs(value) <= tolerance * magnitude[i])) return true;
        const terms = this.terms(at, this.reference);
        return at.Phi.every((value, i) => Math.abs(value) <= tolerance * terms[i] + noise[i]);
    }

    /* Whether every equation holds as well as floating point permits. */
    holdsToRounding(at) {
        const { reference, place } = this;
        const scale = at.q.map((x, k) => Math.min(Math.max(Math.abs(x), reference[k]), WILD * reference[k] + place[k]));
        const terms = this.terms(at, scale);
        return at.Phi.every((value, i) => Math.abs(value) <= ROUNDING * terms[i]);
    }

    distance(q, other, scale = this.reference) {
        let most = 0;
        for (let k = 0; k < this.n; k += 1) {
            const apart = Math.abs(q[k] - other[k]) / scale[k];
            if (!(apart <= most)) most = apart;
        }
        return most;
    }

    /* The way from a guess to a position as a mechanism shows it: whole turns of an angle are no
       way, and Euler parameters p and -p are one orientation. */
    apart(q, guess) {
        const turns = (x, k) => (this.angular[k] ? 2 * Math.PI * Math.round(x / (2 * Math.PI)) : 0);
        const way = Float64Array.from(q, (x, k) => x - guess[k] - turns(x - guess[k], k));
        for (const cover of this.covers) {
            const along = cover.reduce((sum, k) => sum + q[k] * guess[k], 0);
            for (const k of cover) way[k] = along < 0 ? q[k] + guess[k] : q[k] - guess[k];
        }
        return way;
    }

    /* How long that way is, in scales. */
    away(q, guess, scale = this.near) {
        return largest(this.apart(q, guess).map((x, k) => x / scale[k]));
    }

    isFar(q, guess) {
        const way = this.apart(q, guess);
        return this.mayTurn.some((may, k) => may && Math.abs(way[k]) > FAR);
    }

    /* Whether a guess shows a branch, and a position found from it lies on another. */
    leavesBranch(guess, found) {
        if (this.model.REDUNDANT) return false;  // nothing has a determinant but the others' rows
        const wanted = this.determinants(guess), here = this.determinants(found);
        const shows = wanted.every((x, k) => x !== 0 && !(Math.abs(x) <= FOLDED * Math.abs(here[k])));
        return shows && wanted.some((x, k) => Math.sign(x) !== Math.sign(here[k]));
    }

    /* Whether a position found from a guess is not what the guess shows. */
    strays(guess, found) {
        const isFar = this.isFar(found.q, guess.q) || this.away(found.q, guess.q) > ASTRAY;
        return isFar || this.leavesBranch(guess, found);
    }

    /* About where the mechanism can be assembled beyond the nearest singular position: along its
       movement v the smallest singular value u^T Phi_q v falls to zero half way. Null where the
       mechanism is too large. */
    otherSide(at) {
        if (this.n > MOST_MIRRORED) return null;
        const { near } = this, here = scaledRows(this, at, near);
        if (!here.every(allFinite)) return null;
        const [{ size, direction, image }] = singularValues(here);
        const aside = this.evaluate(at.q.map((x, k) => x + MIRROR_STEP * near[k] * direction[k]), at.t);
        const there = scaledRows(this, aside, near);
        const bend = here.reduce((total, row, i) => {
            return total + image[i] / size * row.reduce((sum, x, k) => sum + (there[i][k] - x) * direction[k], 0);
        }, 0) / MIRROR_STEP;
        return at.q.map((x, k) => x - 2 * size / bend * near[k] * direction[k]);
    }
}

/* ---- Newton's method from a guess ---- */

/* Whether corrections shrink no faster than towards a double root, by halves. */
function crawls(corrections) {
    const [before, last] = corrections.slice(-2);
    return corrections.length > 1 && last > before / 4;
}

function hasConverged(equations, before, at, corrections) {
    const allowed = k => Math.max(TOLERANCE, equations.floor) * equations.reference[k] + ROUNDING * Math.abs(at.q[k]);
    const isSmall = at.q.every((x, k) => Math.abs(x - before.q[k]) <= allowed(k));
    if (isSmall && equations.holds(at, ASSEMBLED)) return true;
    return (isSmall || crawls(corrections)) && equations.holdsToRounding(at);
}

const whySingular = at => (allFinite(at.Phi_q) ? SINGULAR : NOT_FINITE);
const moved = (equations, at, step, part = 1) => {
    const following = equations.evaluate(at.q.map((x, k) => x + part * step[k]), at.t);
    return allFinite(following.Phi) ? following : null;
};

/* The whole correction; of redundant equations that which misses all of them least. */
function plainStep(equations, at) {
    const { model } = equations, factors = equations.factors(at), right = at.Phi.map(value => -value);
    const step = model.REDUNDANT ? leastSquares(model.rows_of(at, "Phi_q"), right) : solve(factors, right);
    if (factors.dependent.length || !allFinite(step)) return whySingular(at);
    const following = moved(equations, at, step);
    return following ? [following, norm(step)] : NOT_FINITE;
}

/* As much of the correction, bent towards the gradient while the residual is large, as keeps the
   angles near and lowers the residual. */
function safeguardedStep(equations, at) {
    const { reference, angular } = equations;
    const weights = Array.from(equations.weights(equations.terms(at, reference)));
    const weighed = ({ Phi }) => norm(weights.map((x, i) => x * Phi[i]));
    const before = weighed(at), bend = Math.sqrt(BEND * Math.min(1, before));
    const rows = equations.model.rows_of(at, "Phi_q").map((row, i) => row.map((x, k) => weights[i] * x * reference[k]));
    if (!rows.every(allFinite)) return NOT_FINITE;
    rows.push(...rows[0].map((_, k) => rows[0].map((_, j) => (j === k ? bend : 0))));
    const right = [...weights.map((x, i) => -x * at.Phi[i]), ...rows[0].map(() => 0)];
    const step = leastSquares(rows, right).map((x, k) => x * reference[k]);
    const excess = largest(step.map((x, k) => x / (reference[k] * (angular[k] ? LARGEST_ANGLE : 1))));
    for (let part = Math.min(1, 1 / (excess || 1)); part >= SHORTEST_STEP; part /= 2) {
        const following = moved(equations, at, step, part);
        const after = following && weighed(following);
        if (following && (after <= (1 - SUFFICIENT * part) * before || after <= ROUNDING)) {
            return [following, part * norm(step)];
        }
    }
    return NOT_CONVERGED;
}

/* All positions from a guess, and how they end. */
function iterate(equations, t, guess, most = MAX_ITERATIONS, step = plainStep) {
    const points = [equations.evaluate(guess, t)], corrections = [];
    const ended = status => ({ status, points, corrections, last: points[points.length - 1] });
    if (!allFinite(points[0].Phi)) return { ...ended(NOT_FINITE), last: null };
    for (let k = 0; k < most; k += 1) {
        const outcome = step(equations, points[k]);
        if (typeof outcome === "number") return ended(outcome);
        points.push(outcome[0]);
        corrections.push(outcome[1]);
        if (hasConverged(equations, points[k], outcome[0], corrections)) return ended(CONVERGED);
    }
    const creeps = crawls(corrections) && equations.holds(points[points.length - 1], ASSEMBLED);
    return ended(creeps ? SINGULAR : NOT_CONVERGED);
}

/* A position from a guess: by plain steps, and by safeguarded ones where these fail or stray; then
   the assembly on the other side of the nearest singular position is looked at too. `other` is
   another one that is as near to the guess. */
function assemble(equations, t, guess) {
    const plain = iterate(equations, t, guess), isFound = plain.status === CONVERGED;
    if (!plain.last || (isFound && equations.distance(plain.last.q, guess, equations.near) <= SETTLED)) return plain;
    const meant = turned(equations, plain.points);
    if (meant) {
        const attempt = assemble(equations, t, meant);
        if (attempt.status === CONVERGED) attempt.last = unwound(equations, t, attempt.last, guess);
        return attempt;
    }
    const away = q => equations.away(q, guess);
    const isSound = isFound && !isThrown(equations, plain.points);
    let good = ordered(equations, plain.points[0], [plain]);
    if (!isSound || equations.strays(plain.points[0], plain.last)) {
        const attempts = safeguarded(equations, t, guess, isSound);
        const found = ordered(equations, plain.points[0], isSound ? [plain, ...attempts] : attempts);
        if (found.length) good = found;
        if (!good.length) return leastMissed(equations, attempts);
    }
    const mirrored = equations.otherSide(good[0].last), near = Math.max(1, away(good[0].last.q));
    if (mirrored && away(mirrored) <= MIRRORED * near) {
        const beyond = iterate(equations, t, mirrored);
        if (beyond.last && !isThrown(equations, beyond.points) && away(beyond.last.q) <= Math.min(AS_NEAR * near, MIRRORED)) {
            good = ordered(equations, plain.points[0], [...good, beyond]);
        }
    }
    const [first, ...rest] = good, reach = AS_NEAR * away(first.last.q);
    const isOther = q => equations.away(q, first.last.q, equations.reference) > SAME_POSITION && away(q) <= reach;
    first.other = rest.find(({ last }) => isOther(last.q))?.last ?? null;
    return first;
}

/* Whether a way went so far that rounding errors decide where it ends. */
function isThrown(equations, way) {
    return way.some(at => !(equations.distance(at.q, way[0].q, equations.near) <= THROWN));
}

/* A guess with angles turned by whole turns towards its first correction, where the equations say
   which turn is meant and miss less then; null where there is none. */
function turned(equations, way) {
    const weights = equations.weights(), missed = ({ Phi }) => norm(weights.map((x, i) => x * Phi[i]));
    const turns = way[0].q.map((x, k) => Math.round((way[Math.min(1, way.length - 1)].q[k] - x) / (2 * Math.PI)));
    let guess = way[0];
    const at = (some, count) => {
        return equations.evaluate(guess.q.map((x, k) => x + (some.includes(k) ? 2 * Math.PI * count(k) : 0)), guess.t);
    };
    const isBound = k => {
        const { Phi } = at([k], () => 1);
        return !(norm(weights.map((x, i) => x * (Phi[i] - guess.Phi[i]))) <= SAME_POSITION);
    };
    const columns = [...turns.keys()].filter(k => equations.angular[k] && turns[k] && isBound(k));
    for (const some of [columns, ...(columns.length <= MOST_TURNED ? columns.map(k => [k]) : [])]) {
        const other = at(some, k => turns[k]);
        if (!(missed(other) < (1 - SUFFICIENT) * missed(guess))) continue;
        guess = other;
        for (const k of some) turns[k] = 0;
    }
    return guess === way[0] ? null : Float64Array.from(guess.q);
}

/* Safeguarded attempts, from further and further away until one converges. */
function safeguarded(equations, t, guess, isFound) {
    const attempts = [], { reference, probe } = equations;
    for (let k = 0; k <= (isFound ? 0 : RESTARTS); k += 1) {
        // With all bodies on a line no equation tells which way to bend.
        const bend = j => (k ? k * NUDGE * reference[j] * probe[(j - (k - 1) + probe.length) % probe.length] : 0);
        const begin = Float64Array.from(guess, (x, j) => x + bend(j));
        attempts.push(iterate(equations, t, begin, MAX_ITERATIONS, safeguardedStep));
        if (attempts[attempts.length - 1].status === CONVERGED) break;
    }
    return attempts;
}

function leastMissed(equations, attempts) {
    const weights = equations.weights();
    const missed = ({ last }) => (last ? norm(weights.map((x, i) => x * last.Phi[i])) : Infinity);
    return attempts.reduce((best, attempt) => (missed(attempt) < missed(best) ? attempt : best));
}

/* The attempts that converged, angles turned back: what is near the guess comes first, the nearest
   of it; then what is not far, then what is on its branch, then the nearer. */
function ordered(equations, guess, attempts) {
    const good = attempts.filter(({ status }) => status === CONVERGED);
    const orders = new Map(good.map(attempt => {
        const at = attempt.last = unwound(equations, guess.t, attempt.last, guess.q);
        const away = +equations.away(at.q, guess.q).toFixed(6);
        const isFar = equations.isFar(at.q, guess.q), leaves = !isFar && equations.leavesBranch(guess, at);
        return [attempt, [Math.min(away, 1), isFar, leaves, +equations.away(at.q, guess.q, equations.reference).toFixed(6)]];
    }));
    return good.sort((one, other) => {
        const [a, b] = [orders.get(one), orders.get(other)], k = a.findIndex((x, i) => x !== b[i]);
        return k < 0 ? 0 : a[k] - b[k];
    });
}

/* Turn angles by whole turns towards a guess, as far as the equations allow it. */
function unwound(equations, t, at, guess) {
    const { angular, mayTurn } = equations;
    const columns = [...guess.keys()].filter(k => (angular[k] || mayTurn[k]) && Math.abs(at.q[k] - guess[k]) > Math.PI);
    const each = columns.length <= MOST_TURNED ? columns.map(k => [k]) : [];
    for (const some of [columns, ...each]) {
        const q = at.q.slice();
        for (const k of some) q[k] -= 2 * Math.PI * Math.round((q[k] - guess[k]) / (2 * Math.PI));
        if (q.every((x, k) => x === at.q[k])) continue;
        const turned = iterate(equations, t, q, MAX_CORRECTIONS);
        if (turned.status === CONVERGED && equations.distance(turned.last.q, q) <= SAME_POSITION) at = turned.last;
    }
    return covered(equations, t, at, guess);
}

/* Give Euler parameters the signs of a guess's, as far as the equations allow it. Where they are as
   far from it either way, the largest one becomes positive. */
function covered(equations, t, at, guess) {
    for (const cover of equations.covers) {
        const along = cover.reduce((sum, k) => sum + at.q[k] * guess[k], 0);
        const most = cover.reduce((best, k) => (Math.abs(at.q[k]) > Math.abs(at.q[best]) ? k : best));
        if ((Math.abs(along) > SAME_POSITION ? along : at.q[most]) >= 0) continue;
        const other = equations.evaluate(at.q.map((x, k) => (cover.includes(k) ? -x : x)), t);
        if (allFinite(other.Phi) && equations.holds(other, ASSEMBLED)) at = other;
    }
    return at;
}
