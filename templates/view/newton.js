/* Newton's method for Phi(q, t) = 0 step by step, by the plain attempt of the emitted solver, and what
   is to be said of it. No document here, so that node can test it. */

export const newton = (() => {
  const MOST_NAMES = 6;  // in a statement
  const SAME_POSITION = 1e-6;  // relative to the scale of a coordinate
  const STATUSES = ['converged', 'not converged', 'singular', 'not finite'];

  const norm = vector => Math.hypot(...vector);
  const largest = vector => vector.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

  /* The equations with their scales, which are those at the model's guess. */
  function problem(model, p = model.DEFAULTS) {
    return new model.solver.Problem(model, p, model.GUESS, 0);
  }

  /* All iterates from a guess: the position, what the equations say there, and the correction that
     led to it; and how they end: 'converged', 'singular' (then `dependent` are columns of Phi_q at
     the last iterate), 'not finite' or 'not converged'. */
  function iterate(model, guess, t, p = model.DEFAULTS) {
    const equations = problem(model, p), { status, points } = model.solver.iterates(equations, t, guess);
    const iterates = points.map((at, k) => {
      const step = k ? Array.from(at.q, (x, j) => x - points[k - 1].q[j]) : null;
      const Phi_q = model.rows_of(at, 'Phi_q'), factors = equations.factors(at);
      return { q: Array.from(at.q), Phi: Array.from(at.Phi), Phi_q, factors, step, correction: step ? norm(step) : NaN };
    });
    // From where Phi_q is singular but for rounding, the solver steps far away.
    const hasStep = (_, k) => k < iterates.length - 1 || status > 1;
    const stop = iterates.findIndex((item, k) => hasStep(item, k) && item.factors.dependent.length);
    const isFinite = stop >= 0 && iterates[stop].Phi_q.flat().every(Number.isFinite);
    const ended = stop < 0 ? status : isFinite ? 2 : 3;
    return {
      status: STATUSES[ended], iterates: stop < 0 ? iterates : iterates.slice(0, stop + 1),
      scale: Array.from(equations.reference), dependent: isFinite ? iterates[stop].factors.dependent : [],
    };
  }

  /* How a position differs from another one: the coordinates that do, an angle only modulo a turn,
     and the angles that are whole turns away. */
  function difference(model, scale, q, other) {
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

  const crawls = ({ iterates }) => {
    const [before, last] = iterates.slice(-2).map(iterate => iterate.correction);
    return last > before / 4;
  };

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
    if (run.status === 'singular' || (run.status === 'converged' && crawls(run))) {
      return `After ${iterations} the corrections still only halve: \u03a6_q is singular at the ` +
        `position they creep to, ${dependence(model, weakColumns(model, last, run.scale))}.`;
    }
    switch (run.status) {
      case 'converged':
        return `Converged in ${iterations} ${branch(model, run, t, p, motion)}`;
      case 'not finite':
        return `Stopped after ${iterations}: the equations have no finite value at the next one.`;
      default:
        return `No convergence in ${iterations}: the last correction is still ` +
          `${last.correction.toExponential(1)}. This guess is too far away; kc.solve would start ` +
          'again from it, with shortened corrections.';
    }
  }

  function branch(model, { iterates, scale }, t, p, motion) {
    if (!motion) return 'to a position; the motion has none at this time.';
    const last = iterates[iterates.length - 1];
    const apart = difference(model, scale, last.q, motion);
    if (!apart.coordinates.length) {
      const turned = apart.turned.map(({ name, turns }) => `${name} by ${turns} \u00d7 2\u03c0`);
      const further = turned.length ? `, turned further: ${turned.join(', ')}` : '';
      return `to the position of the motion${further}.`;
    }
    const here = Math.sign(last.factors.determinant);
    const there = Math.sign(model.solver.linear.factor(model.Phi_q(motion, t, p)).determinant);
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
  function weakColumns(model, { factors, q }, scale) {
    if (factors.dependent.length) return factors.dependent;
    const direction = model.solver.linear.solve(factors, q.map(() => 1)).map((x, k) => x / scale[k]);
    const most = largest(direction);
    return [...direction.keys()].filter(k => Math.abs(direction[k]) > 0.01 * most);
  }

  return { problem, iterate, statement, norm, largest };
})();
