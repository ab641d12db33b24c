'use strict';
/* Newton's method for Phi(q, t) = 0 on emitted functions, step for step as the runtime's plain
   attempt does it: Phi_q dq = -Phi, q + dq, until the correction is small and the equations hold.
   No document here, so that node can test it. */

const newton = (() => {
  const TOLERANCE = 1e-10;  // of the last correction, relative to 1 + |q|; it has been applied
  const RESIDUAL_FACTOR = 10;  // how much larger a residual may be, relative to its terms
  const ROUNDING = 16 * Number.EPSILON;  // all that floating point has to give, relative to terms
  const MOST_ITERATIONS = 25;
  const MOST_NAMES = 6;  // in a statement
  const SAME_POSITION = 1e-6;  // relative to the scale of a coordinate

  const norm = vector => Math.hypot(...vector);
  const largest = vector => vector.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

  /* Factor a square matrix with partial pivoting: rows of L and U in one, the order of the rows,
     and the determinant. Where a pivot vanishes, `dependent` holds the columns whose combination
     is zero, and there is no solution. */
  function factor(matrix) {
    const n = matrix.length;
    const rows = matrix.map(row => row.slice());
    const order = rows.map((_, k) => k);
    let determinant = 1;
    for (let k = 0; k < n; k += 1) {
      let best = k;
      for (let i = k + 1; i < n; i += 1) {
        if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
      }
      const rounding = n * Number.EPSILON * largest(matrix.map(row => row[k]));
      if (!(Math.abs(rows[best][k]) > rounding)) {
        return { rows, order, determinant: 0, dependent: dependentColumns(rows, k) };
      }
      if (best !== k) {
        [rows[k], rows[best]] = [rows[best], rows[k]];
        [order[k], order[best]] = [order[best], order[k]];
        determinant = -determinant;
      }
      determinant *= rows[k][k];
      for (let i = k + 1; i < n; i += 1) {
        rows[i][k] /= rows[k][k];
        for (let j = k + 1; j < n; j += 1) rows[i][j] -= rows[i][k] * rows[k][j];
      }
    }
    return { rows, order, determinant, dependent: [] };
  }

  /* The columns that take part where column k is a combination of those before it. */
  function dependentColumns(rows, k) {
    const weights = upperSolution(rows, rows.slice(0, k).map(row => row[k]));
    const most = Math.max(1, largest(weights));
    return [...weights.keys()].filter(j => Math.abs(weights[j]) > 1e-9 * most).concat(k);
  }

  /* x of U x = b, U in the first rows of a factored matrix. */
  function upperSolution(rows, b) {
    const x = b.slice();
    for (let k = x.length - 1; k >= 0; k -= 1) {
      for (let j = k + 1; j < x.length; j += 1) x[k] -= rows[k][j] * x[j];
      x[k] /= rows[k][k];
    }
    return x;
  }

  /* x of A x = b from the factors of A. */
  function solve({ rows, order }, b) {
    const y = order.map(k => b[k]);
    for (let k = 0; k < y.length; k += 1) {
      for (let j = 0; j < k; j += 1) y[k] -= rows[k][j] * y[j];
    }
    return upperSolution(rows, y);
  }

  /* The scale of each coordinate: 1 rad for angles, the size of the mechanism for the others. */
  function scales(model, q) {
    const isAngle = model.COORDINATES.map(name => model.UNITS[name] === 'rad');
    const lengths = [...q, ...model.GUESS].filter((_, k) => !isAngle[k % q.length]);
    const size = largest(lengths) || 1;
    return isAngle.map(angular => (angular ? 1 : size));
  }

  /* An iterate: the position, what the equations say there, and the correction that led to it. */
  function iterateAt(model, q, t, p, step) {
    const Phi = model.Phi(q, t, p);
    const Phi_q = model.Phi_q(q, t, p);
    const factors = factor(Phi_q);
    return { q, Phi, Phi_q, factors, step, correction: step ? norm(step) : NaN };
  }

  const isFinite = ({ Phi, Phi_q }) => [Phi, ...Phi_q].every(row => row.every(Number.isFinite));

  /* By how much the equations are missed, relative to what their terms contribute here or at the
     guess: at a dead point a whole row of Phi_q may vanish. */
  function missed(iterate, guess, scale) {
    const terms = (Phi_q, i) => Phi_q[i].reduce((sum, x, j) => sum + Math.abs(x) * scale[j], 0);
    return largest(iterate.Phi.map((value, i) => {
      return value / (Math.max(terms(iterate.Phi_q, i), terms(guess.Phi_q, i)) || 1);
    }));
  }

  /* Whether the corrections shrink no faster than towards a double root, by halves. */
  function crawls(iterates) {
    const [before, last] = iterates.slice(-2).map(iterate => iterate.correction);
    return last > before / 4;
  }

  function hasConverged(iterates, scale) {
    const last = iterates[iterates.length - 1];
    const error = missed(last, iterates[0], scale);
    const isSmall = last.correction <= TOLERANCE * (1 + norm(last.q));
    if (isSmall && error <= RESIDUAL_FACTOR * TOLERANCE) return true;
    return (isSmall || crawls(iterates)) && error <= ROUNDING;
  }

  /* All iterates from a guess, and how they end: 'converged', 'singular' (then `dependent` are
     columns of Phi_q at the last iterate), 'not finite' or 'not converged'. */
  function iterate(model, guess, t, p = model.DEFAULTS) {
    const scale = scales(model, guess);
    const iterates = [iterateAt(model, guess.slice(), t, p, null)];
    const ended = (status, dependent = []) => ({ status, iterates, dependent });
    if (!isFinite(iterates[0])) return ended('not finite');
    for (let k = 1; k <= MOST_ITERATIONS; k += 1) {
      const { q, Phi, factors } = iterates[k - 1];
      if (factors.dependent.length) return ended('singular', factors.dependent);
      const step = solve(factors, Phi.map(value => -value));
      const following = iterateAt(model, q.map((x, j) => x + step[j]), t, p, step);
      if (!isFinite(following)) return ended('not finite');
      iterates.push(following);
      if (hasConverged(iterates, scale)) return ended('converged');
    }
    const isNear = missed(iterates[MOST_ITERATIONS], iterates[0], scale) <= 10 * TOLERANCE;
    return ended(isNear && crawls(iterates) ? 'singular' : 'not converged');
  }

  /* How a position differs from another one: the coordinates that do, an angle only modulo a turn,
     and the angles that are whole turns away. */
  function difference(model, q, other) {
    const scale = scales(model, other);
    const apart = { coordinates: [], turned: [] };
    model.COORDINATES.forEach((name, k) => {
      const isAngle = model.UNITS[name] === 'rad';
      const turns = isAngle ? Math.round((q[k] - other[k]) / (2 * Math.PI)) : 0;
      const rest = Math.abs(q[k] - other[k] - 2 * Math.PI * turns);
      if (!(rest <= SAME_POSITION * scale[k])) apart.coordinates.push(name);
      else if (turns) apart.turned.push({ name, turns });
    });
    return apart;
  }

  /* What to say of a run: how it ended, and on which branch. `motion` is the position that the
     motion has at this time, null where it has none. */
  function statement(model, run, t, p, motion) {
    const count = run.iterates.length - 1;
    const iterations = count === 1 ? '1 iteration' : `${count} iterations`;
    const last = run.iterates[count];
    if (run.dependent.length) {
      return `Stopped after ${iterations}: \u03a6_q is singular there, ` +
        `${dependence(model, run.dependent)}.`;
    }
    // A double root that was reached to rounding has converged, but not as Newton's method does.
    if (run.status === 'singular' || (run.status === 'converged' && crawls(run.iterates))) {
      return `After ${iterations} the corrections still only halve: \u03a6_q is singular at the ` +
        `position they creep to, ${dependence(model, weakColumns(model, last))}.`;
    }
    switch (run.status) {
      case 'converged':
        return `Converged in ${iterations} ${branch(model, last, t, p, motion)}`;
      case 'not finite':
        return `Stopped after ${iterations}: the equations have no finite value at the next one.`;
      default:
        return `No convergence in ${iterations}: the last correction is still ` +
          `${last.correction.toExponential(1)}. This guess is too far away; kc.solve would start ` +
          'again from it, with shortened corrections.';
    }
  }

  function branch(model, last, t, p, motion) {
    if (!motion) return 'to a position; the motion has none at this time.';
    const apart = difference(model, last.q, motion);
    if (!apart.coordinates.length) {
      const turned = apart.turned.map(({ name, turns }) => `${name} by ${turns} \u00d7 2\u03c0`);
      const further = turned.length ? `, turned further: ${turned.join(', ')}` : '';
      return `to the position of the motion${further}.`;
    }
    const here = Math.sign(last.factors.determinant);
    const there = Math.sign(factor(model.Phi_q(motion, t, p)).determinant);
    const more = apart.coordinates.length - MOST_NAMES;
    const named = apart.coordinates.slice(0, MOST_NAMES).join(', ');
    const differ = `Other than in the motion: ${named}${more > 0 ? ` and ${more} more` : ''}.`;
    if (here === there) {
      return `to another position, where det \u03a6_q has the sign it has in the motion. ${differ}`;
    }
    const signs = { '-1': 'negative', 0: 'zero', 1: 'positive' };
    return `to the other branch: det \u03a6_q is ${signs[here]} there and ${signs[there]} in the ` +
      `motion. ${differ}`;
  }

  function dependence(model, columns) {
    const names = columns.map(k => model.COORDINATES[k]).join(', ');
    return columns.length > 1 ? `its columns ${names} depend on each other`
      : `its column ${names} vanishes`;
  }

  /* The columns that nearly depend on each other: one step of inverse iteration. */
  function weakColumns(model, { factors, q }) {
    if (factors.dependent.length) return factors.dependent;
    const scale = scales(model, q);
    const direction = solve(factors, q.map(() => 1)).map((x, k) => x / scale[k]);
    const most = largest(direction);
    return [...direction.keys()].filter(k => Math.abs(direction[k]) > 0.01 * most);
  }

  return { factor, solve, iterate, statement, scales, norm, largest };
})();
