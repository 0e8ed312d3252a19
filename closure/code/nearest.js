// The nearest singular posture: Newton's method on the bordered equations.

// Closure rows, K, J and P at q, dimensionless.
function firstOrderAt(q) {
    const values = new Float64Array(ROWS), flat = new Float64Array(MATRIX_ROWS * V);
    closureValues(q, values);
    allMatrices(q, flat);
    const rows = Array.from({length: MATRIX_ROWS}, (_, i) => flat.subarray(i * V, (i + 1) * V));
    return {
        values,
        closures: rows.slice(0, ROWS),
        task: rows.slice(ROWS, FIRST_RATE),
        rates: rows.slice(FIRST_RATE, FIRST_RATE + RATES),
    };
}

// The matrix whose loss of ranks a kind is, its rows and columns, and the corank that is sought.
const SHAPES = {
    direct: [K_RANK, PASSIVE.length],
    inverse: [K_RANK + OUTPUTS, V],
    constraint: [K_RANK, V],
};
const codimension = ([rows, columns], corank) => (Math.abs(rows - columns) + corank) * corank;

// Corner of the bordered matrix, with the vectors that its slopes are combined of; see
// `analysis.singularity.sets.bordered`. null where the bordered matrix is singular.
function cornerOf(matrix, [height, width], corank) {
    const flipped = height > width;
    const m = flipped ? transposedRows(matrix, width) : matrix;
    const short = Math.min(height, width), long = Math.max(height, width);
    const below = turnedApart(m).sides.slice(short - corank);
    const beside = rightFactors(m, long).right.slice(short - corank);
    const bordered = [
        ...m.map((row, i) => [...row, ...below.map((b) => b[i])]),
        ...beside.map((c) => [...c, ...below.map(() => 0)]),
    ];
    const size = bordered.length, unit = (k) =>
        Float64Array.from({length: size}, (_, i) => Number(i === k));
    const count = (first) => Array.from({length: size - first}, (_, k) => unit(first + k));
    const right = solved(bordered, count(short));
    const left = right && solved(transposedRows(bordered, size), count(long));
    if (!left) return null;
    const corners = [], pairs = [];
    left.forEach((w, a) => right.forEach((v) => {
        corners.push(v[long + a]);
        const both = [w.subarray(0, short), v.subarray(0, long)];
        pairs.push(flipped ? both.reverse() : both);
    }));
    return {corners: Float64Array.from(corners), pairs};
}

// Slopes of left^T matrix right along motions.
function slopesOf(kind, q, combine, [left, right]) {
    const x = new Float64Array(Q + ROWS + OUTPUTS + V), found = new Float64Array(V);
    x.set(q);
    const closures = combine ? combined([left.subarray(0, K_RANK)], combine)[0]
        : left.subarray(0, K_RANK);
    x.set(closures, Q);
    if (kind === "inverse") x.set(left.subarray(K_RANK), Q + ROWS);
    const along = Q + ROWS + OUTPUTS;
    if (kind === "direct") PASSIVE.forEach((v, i) => { x[along + v] = right[i]; });
    else x.set(right, along);
    allSlopes(x, found);
    return found.map((slope) => -slope);
}

// Closure rows and corners at q, with the slopes of both; null where there are none.
function equationsAt(q, {kind, corank, missing}) {
    const {values, closures, task} = firstOrderAt(q);
    const combine = K_RANK < ROWS || missing ? turnedApart(closures).sides.slice(0, K_RANK) : null;
    const whole = combine ? combined(combine, closures) : closures;
    const kept = combine ? combine.slice(0, K_RANK - missing) : null;
    const matrix = kind === "direct" ? whole.map((row) => PASSIVE.map((v) => row[v]))
        : kind === "inverse" ? [...whole, ...task] : whole;
    const corner = cornerOf(matrix, SHAPES[kind], corank);
    return corner && {
        matrix,
        rows: kept ? times(kept, values) : values,
        slopes: kept ? combined(kept, closures) : closures,
        corners: corner.corners,
        gradients: corner.pairs.map((pair) => slopesOf(kind, q, combine, pair)),
    };
}

// Rows of W^T with |P W y| = |y|, but for motions that no joint rate sees.
function weightsOf(rates) {
    const gram = gramOf(transposedRows(rates, V));
    gram.forEach((row, i) => { row[i] += NEARNESS.FLOATING; });
    const lower = choleskyOf(gram).map((row, i) => row.map((x, j) => (j <= i ? x : 0)));
    const unit = Array.from({length: V}, (_, k) =>
        Float64Array.from({length: V}, (_, i) => Number(i === k)));
    return transposedRows(solved(lower, unit), V);
}

// Dimensionless motion from a posture to another; floating joints along the outer axes.
function motionTo(from, to) {
    const found = new Float64Array(V);
    for (const {q, v, scale, floating} of JOINTS) {
        if (!floating) {
            found[v] = (to[q] - from[q]) / scale;
            continue;
        }
        for (let k = 0; k < 3; ++k) found[v + k] = (to[q + k] - from[q + k]) / scale;
        const [x, y, z, w] = from.subarray(q + 3), [a, b, c, d] = to.subarray(q + 3);
        const turn = [a * w - d * x - b * z + c * y, b * w - d * y - c * x + a * z,
            c * w - d * z - a * y + b * x];
        const sine = Math.hypot(...turn), cosine = a * x + b * y + c * z + d * w;
        const angle = 2 * Math.atan2(sine, Math.abs(cosine));
        const share = (sine > 0 ? angle / sine : 2) * (cosine < 0 ? -1 : 1);
        turn.forEach((part, k) => { found[v + 3 + k] = share * part; });
    }
    return found;
}

function stepped(q, step) {
    const found = new Float64Array(Q);
    moved([...q, ...step], found);
    return found;
}

// How far Newton's method ends from a posture, whose equations are `at`.
function distanceTo(place, wanted, at) {
    const {ROUNDING, STEPS, LONGEST, KNOWN, FALLEN} = NEARNESS;
    const begin = greatest(at.corners), size = (motion) => Math.hypot(...times(place.rates, motion));
    let q = place.q, away = 0;
    for (let k = 0; k < STEPS; ++k) {
        if (greatest(at.corners) <= ROUNDING) return away;
        const scales = at.gradients.map((x) => Math.sqrt(inner(x, x)));
        const told = scales.map((_, i) => i).filter((i) => scales[i] > ROUNDING);
        const rows = [...at.slopes, ...told.map((i) => at.gradients[i].map((x) => x / scales[i]))];
        const values = [...at.rows, ...told.map((i) => at.corners[i] / scales[i])];
        const weighted = rows.map((row) => times(place.weights, row));
        const y = leastSolution(weighted, values, V), step = new Float64Array(V);
        place.weights.forEach((row, i) => row.forEach((x, j) => { step[j] -= x * y[i]; }));
        const length = size(step);
        if (!Number.isFinite(length)) return Infinity;
        const share = Math.min(1, LONGEST / Math.max(length, 1e-300)), before = away;
        q = stepped(q, step.map((x) => share * x));
        away = size(motionTo(place.q, q));
        at = equationsAt(q, wanted);
        if (at === null) return Infinity;
        const settled = Math.abs(away - before) < 1e-3 * away + 1e-3 * KNOWN;
        if (length < 1e-3 * Math.max(KNOWN, away) && settled) break;
    }
    return greatest(at.corners) <= Math.max(FALLEN * begin, ROUNDING) ? away : Infinity;
}

// To which the root alone tells a posture, where it lies beside a fold; else 0.
function foldAccuracy(place, {kind, corank}, at) {
    const {SAFETY, ROUNDING, ROOT} = NEARNESS, [height, width] = SHAPES[kind];
    const rounding = SAFETY * (Math.min(place.residual, CLOSED) + ROUNDING);
    const size = greatest(at.corners);
    const reach = Math.min(rounding / Math.max(size, 1e-300), ROOT * Math.sqrt(rounding));
    const count = corank + Math.max(width - height, 0);
    const motions = rightFactors(at.matrix, width).right.slice(width - count).map((x) => {
        if (kind !== "direct") return x;
        const whole = new Float64Array(V);
        PASSIVE.forEach((v, i) => { whole[v] = x[i]; });
        return whole;
    });
    const slopes = at.gradients.map((x) => times(motions, x));
    const along = leastSolution(slopes, at.corners.map((x) => -x), count);
    const left = greatest(slopes.map((row, i) => inner(row, along) + at.corners[i]));
    const motion = combined([along], motions)[0];
    const away = Math.hypot(...times(place.rates, motion));
    return left <= 0.1 * size && away <= reach ? reach : 0;
}

// The posture where the matrix of a kind, of a generic rank, has `lost` ranks less.
function nearestSingular(place, kind, rank, lost) {
    const corank = Math.min(...SHAPES[kind]) - rank + lost;
    const wanted = {kind, corank, missing: kind === "constraint" ? lost : place.lost};
    const at = equationsAt(place.q, wanted);
    if (at === null) return {distance: Infinity, accuracy: place.accuracy};
    const accuracy = Math.max(place.accuracy, foldAccuracy(place, wanted, at));
    return {distance: distanceTo(place, wanted, at), accuracy};
}
