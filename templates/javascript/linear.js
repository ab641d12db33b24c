/* ---- dense matrices, as arrays of rows ---- */

/* Factor a square matrix with partial pivoting: rows of L and U in one, the order of the rows,
   and the determinant. Where a pivot is a rounding error, `dependent` holds the columns whose
   combination is zero. */
function factor(matrix) {
    const n = matrix.length, rows = matrix.map(row => Array.from(row));
    const order = rows.map((_, k) => k);
    const sizes = order.map(k => matrix.reduce((most, row) => Math.max(most, Math.abs(row[k])), 0));
    let determinant = 1, dependent = [];
    for (let k = 0; k < n; k += 1) {
        let best = k;
        for (let i = k + 1; i < n; i += 1) {
            if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
        }
        if (!(Math.abs(rows[best][k]) > n * Number.EPSILON * sizes[k]) && !dependent.length) {
            dependent = dependentColumns(rows, k);
        }
        if (best !== k) {
            [rows[k], rows[best]] = [rows[best], rows[k]];
            [order[k], order[best]] = [order[best], order[k]];
            determinant = -determinant;
        }
        const pivot = rows[k];
        determinant *= pivot[k];
        for (let i = k + 1; i < n; i += 1) {
            const row = rows[i];
            row[k] /= pivot[k];
            if (row[k] !== 0) for (let j = k + 1; j < n; j += 1) row[j] -= row[k] * pivot[j];
        }
    }
    return { rows, order, determinant: dependent.length ? 0 : determinant, dependent };
}

/* The columns that take part where column k is a combination of those before it. */
function dependentColumns(rows, k) {
    const weights = upperSolution(rows, rows.slice(0, k).map(row => row[k]));
    const most = Math.max(1, largest(weights));
    return [...weights.keys()].filter(j => Math.abs(weights[j]) > 1e-9 * most).concat(k);
}

/* x of U x = b, U in the first rows of a factored matrix. */
function upperSolution(rows, b) {
    const x = Array.from(b);
    for (let k = x.length - 1; k >= 0; k -= 1) {
        const row = rows[k];
        for (let j = k + 1; j < x.length; j += 1) x[k] -= row[j] * x[j];
        x[k] /= row[k];
    }
    return x;
}

/* The rows that determine the motion: all but those that repeat others. */
function independent({ EQUATIONS, REDUNDANT }, rows) {
    return REDUNDANT ? Array.from(rows).filter((_, i) => !REDUNDANT.includes(EQUATIONS[i])) : rows;
}

/* x of A x = b from the factors of A. */
function solve({ rows, order }, b) {
    const y = order.map(k => b[k]);
    for (let k = 0; k < y.length; k += 1) {
        for (let j = 0; j < k; j += 1) y[k] -= rows[k][j] * y[j];
    }
    return upperSolution(rows, y);
}

/* Singular values, the smallest first, their directions on the right and what the matrix makes of
   these: Jacobi's rotations of pairs of columns. */
function singularValues(matrix) {
    const n = matrix[0].length;
    const columns = Array.from({ length: n }, (_, j) => matrix.map(row => row[j]));
    const directions = columns.map((_, j) => columns.map((_, i) => (i === j ? 1 : 0)));
    const dot = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);
    const rotate = (vectors, i, j, c, s) => {
        const [a, b] = [vectors[i], vectors[j]];
        vectors[i] = a.map((x, k) => c * x - s * b[k]);
        vectors[j] = a.map((x, k) => s * x + c * b[k]);
    };
    for (let sweep = 0, isDone = false; sweep < 60 && !isDone; sweep += 1) {
        isDone = true;
        for (let i = 0; i < n; i += 1) {
            for (let j = i + 1; j < n; j += 1) {
                const [a, b] = [dot(columns[i], columns[i]), dot(columns[j], columns[j])];
                const mixed = dot(columns[i], columns[j]);
                if (!(Math.abs(mixed) > Number.EPSILON * Math.sqrt(a * b))) continue;
                isDone = false;
                const zeta = (b - a) / (2 * mixed);
                const t = Math.sign(zeta || 1) / (Math.abs(zeta) + Math.hypot(1, zeta));
                const c = 1 / Math.hypot(1, t);
                rotate(columns, i, j, c, c * t);
                rotate(directions, i, j, c, c * t);
            }
        }
    }
    const found = columns.map((column, j) => ({ size: norm(column), direction: directions[j], image: column }));
    return found.sort((one, other) => one.size - other.size);
}
