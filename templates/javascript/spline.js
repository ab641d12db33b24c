// A periodic spline, or its derivative of an order, at an angle [rad].
function spline(table, order, angle) {
    const first = table.breaks[0];
    const period = table.breaks[table.breaks.length - 1] - first;
    const turn = (angle - first) % period;
    const within = first + (turn < 0 ? turn + period : turn);
    let k = 0;
    while (k < table.pieces.length - 1 && table.breaks[k + 1] <= within) {
        k += 1;
    }
    let coefficients = table.pieces[k];
    for (let derivative = 1; derivative <= order; derivative += 1) {
        const degree = coefficients.length - 1;
        coefficients = coefficients.slice(0, degree).map((c, j) => c * (degree - j));
    }
    return coefficients.reduce((value, c) => value * (within - table.breaks[k]) + c, 0);
}
