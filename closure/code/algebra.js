// Factors of small matrices, as arrays of rows.

// Vectors `a` made orthogonal by turning them, falling in length, with `sides` turned along.
function turnedApart(vectors) {
    const a = copied(vectors).map((x) => Float64Array.from(x));
    const sides = a.map((_, i) => Float64Array.from({length: a.length}, (_, k) => Number(k === i)));
    const values = singularValues(a, sides);
    return {a, sides, values};
}

const transposedRows = (rows, columns) =>
    Array.from({length: columns}, (_, j) => Float64Array.from(rows, (row) => row[j]));

// A = U S V^T by rows of V^T, all of them; `images` are A V.
function rightFactors(rows, columns) {
    const {a: images, sides, values} = turnedApart(transposedRows(rows, columns));
    return {values: values.slice(0, Math.min(rows.length, columns)), right: sides, images};
}

// Least solution of rows x = wanted; singular values below CUT of the largest are none.
function leastSolution(rows, wanted, columns) {
    const {right, images} = rightFactors(rows, columns);
    const lengths = images.map((x) => inner(x, x)), first = Math.max(0, ...lengths);
    const found = new Float64Array(columns);
    right.forEach((v, k) => {
        if (!(lengths[k] > NEARNESS.CUT ** 2 * first)) return;
        const share = inner(images[k], wanted) / lengths[k];
        for (let i = 0; i < columns; ++i) found[i] += share * v[i];
    });
    return found;
}

// Solutions x of a x = b for columns b, by Gaussian elimination; null where `a` is singular.
function solved(matrix, columns) {
    const size = matrix.length, a = matrix.map((row, i) =>
        Float64Array.of(...row, ...columns.map((b) => b[i])));
    for (let k = 0; k < size; ++k) {
        let best = k;
        for (let i = k + 1; i < size; ++i)
            if (Math.abs(a[i][k]) > Math.abs(a[best][k])) best = i;
        if (!(Math.abs(a[best][k]) > 0)) return null;
        [a[k], a[best]] = [a[best], a[k]];
        for (let i = k + 1; i < size; ++i) {
            const factor = a[i][k] / a[k][k];
            for (let j = k; j < a[i].length; ++j) a[i][j] -= factor * a[k][j];
        }
    }
    return columns.map((_, c) => {
        const x = new Float64Array(size);
        for (let k = size - 1; k >= 0; --k) {
            let value = a[k][size + c];
            for (let j = k + 1; j < size; ++j) value -= a[k][j] * x[j];
            x[k] = value / a[k][k];
        }
        return x;
    });
}

const combined = (combine, rows) => combine.map((weights) => {
    const sum = new Float64Array(rows[0]?.length ?? 0);
    rows.forEach((row, i) => {
        for (let j = 0; j < sum.length; ++j) sum[j] += weights[i] * row[j];
    });
    return sum;
});

const times = (rows, x) => Float64Array.from(rows, (row) => inner(row, x));
const greatest = (numbers) => numbers.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

const gramOf = (rows) => rows.map((x) => Float64Array.from(rows, (y) => inner(x, y)));

// The lower half of l l^T = a, in place.
function choleskyOf(a) {
    for (let i = 0; i < a.length; ++i)
        for (let j = 0; j <= i; ++j) {
            let sum = a[i][j];
            for (let k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
            a[i][j] = i === j ? Math.sqrt(sum) : sum / a[j][j];
        }
    return a;
}

// Solve (l l^T) x = b with the lower half of l, in place.
function solvedBy(l, b) {
    const size = b.length;
    for (let i = 0; i < size; ++i) {
        for (let k = 0; k < i; ++k) b[i] -= l[i][k] * b[k];
        b[i] /= l[i][i];
    }
    for (let i = size - 1; i >= 0; --i) {
        for (let k = i + 1; k < size; ++k) b[i] -= l[k][i] * b[k];
        b[i] /= l[i][i];
    }
    return b;
}
