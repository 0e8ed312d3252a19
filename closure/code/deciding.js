// The decision of `classify`: singular values far from zero count, those that are zero to rounding
// do not, and one in between is judged by how far the nearest singular posture is.

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

const combined = (combine, rows) => combine.map((weights) => {
    const sum = new Float64Array(rows[0]?.length ?? 0);
    rows.forEach((row, i) => {
        for (let j = 0; j < sum.length; ++j) sum[j] += weights[i] * row[j];
    });
    return sum;
});

// The matrix whose loss of ranks a kind is, its rows and columns, and the corank that is sought.
const SHAPES = {
    direct: [K_RANK, PASSIVE.length],
    inverse: [K_RANK + OUTPUTS, V],
    constraint: [K_RANK, V],
};
const codimension = ([rows, columns], corank) => (Math.abs(rows - columns) + corank) * corank;

// -- the nearest singular posture: Newton's method on the bordered equations ----------------------

const times = (rows, x) => Float64Array.from(rows, (row) => inner(row, x));
const greatest = (numbers) => numbers.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

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

// -- ranks ----------------------------------------------------------------------------------------

// A posture where K lacks `lost` ranks; `least` is the least singular value of K that counts.
function placeAt(q, at, least, lost) {
    const {KNOWN, SAFETY, ROUNDING} = NEARNESS, residual = greatest(at.values);
    const accuracy = Math.max(KNOWN, (SAFETY * (residual + ROUNDING)) / Math.max(least, 1e-300));
    let weights = null;
    return {
        q, residual, least, lost, accuracy, rates: at.rates,
        get weights() { return (weights ??= weightsOf(at.rates)); },
    };
}

const below = ({values, scale, count}, share) =>
    count - values.slice(0, count).filter((x) => x > share * scale).length;

// How many singular values are not zero, and the nearest singular posture.
function kept(place, kind, spectrum, generic) {
    const {NEAR, FARTHEST, UNFOUND, MOST, ROUNDING} = NEARNESS, {count, scale} = spectrum;
    const before = kind === "inverse" ? place.lost : 0, {accuracy} = place;
    const weak = Math.min(Math.max(place.least, 0.1), 1);
    const rounding = (ROUNDING * Math.max(1, V / 10)) / weak;
    const small = below(spectrum, Math.max(NEAR, Math.min(accuracy, FARTHEST)));
    const unfound = below(spectrum, UNFOUND);
    const zero = below(spectrum, rounding / Math.min(scale, 1));
    const short = Math.min(...SHAPES[kind]) - generic;
    const blurred = kind !== "constraint" && place.least < NEAR;
    let nearest = {distance: zero ? 0 : Infinity, accuracy};
    for (let lost = small; lost > zero; --lost) {
        const many = codimension(SHAPES[kind], short + before + lost) > MOST;
        let found = blurred || many ? {distance: Infinity, accuracy}
            : nearestSingular(place, kind, generic, before + lost);
        if (lost <= unfound && !Number.isFinite(found.distance)) found = {distance: 0, accuracy};
        if (found.distance <= found.accuracy) return {rank: count - lost, nearest: found};
        nearest = zero ? nearest : found;
    }
    return {rank: count - zero, nearest};
}

// Dimension of what two spaces of motions, orthonormal ones, have in common.
function inCommon(one, two) {
    if (!one.length || !two.length) return 0;
    const cosines = turnedApart(one.map((x) => Float64Array.from(two, (y) => inner(x, y)))).values;
    return cosines.filter((x) => x * x > 1 - NEARNESS.SAME).length;
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

// The least singular value of K that counts, from K = L U: by powers of the inverse of L^T L U U^T.
const POWERS = 6;
function leastValue(lu, rank) {
    const lower = Array.from({length: rank}, (_, j) =>
        Float64Array.from(lu, (row, i) => (i < j ? 0 : i === j ? 1 : row[j])));
    const upper = Array.from({length: rank}, (_, i) => lu[i].map((x, j) => (j < i ? 0 : x)));
    const [l, u] = [lower, upper].map((side) => choleskyOf(gramOf(side)));
    let x = Float64Array.from({length: rank}, (_, i) => Math.cos(i * i + 1)), value = 0;
    for (let k = 0; k < POWERS; ++k) {
        const size = Math.hypot(...x);
        x = solvedBy(u, solvedBy(l, x.map((part) => part / size)));
        value = 1 / Math.sqrt(Math.hypot(...x));
    }
    return value;
}

// Closed motions where K is far from losing a rank: without its singular values.
const FAR = 100; // times NEAR
function regularMotions(q, at) {
    const lu = copied(at.closures), found = factors(lu);
    if (found.rank < K_RANK) return null;
    const least = K_RANK ? leastValue(lu, K_RANK) : 1;
    const size = Math.sqrt(at.closures.reduce((sum, row) => sum + inner(row, row), 0));
    if (!(least > FAR * NEARNESS.NEAR * Math.max(1, size))) return null;
    const place = placeAt(q, at, least, 0), {accuracy} = place;
    return {place, motions: kernel(lu, found), nearest: {distance: Infinity, accuracy}};
}

// The same where it is not.
function anyMotions(q, at) {
    const {values, right} = rightFactors(at.closures, V), {NEAR} = NEARNESS;
    const counted = values.slice(0, K_RANK).filter((x) => x > NEAR * values[0]).length;
    const leastOf = (count) => (count ? values[count - 1] : 1);
    const spectrum = {values, scale: Math.max(1, values[0] ?? 0), count: K_RANK};
    const {rank, nearest} =
        kept(placeAt(q, at, leastOf(counted), 0), "constraint", spectrum, K_RANK);
    return {place: placeAt(q, at, leastOf(rank), K_RANK - rank), motions: right.slice(rank), nearest};
}

// Ranks of K, A and T, and of A and T together, as `analysis.singularity.deciding` has them.
function decided(q) {
    const at = firstOrderAt(q);
    const {place, motions, nearest: held} = regularMotions(q, at) ?? anyMotions(q, at);
    orthonormal(along(at.rates, motions), motions);
    const size = motions.length, idle = MOTIONS - GENERIC.inputs;
    const a = rightFactors(transposedRows(inputsIn(motions), INPUT_V.length), size);
    const t = rightFactors(transposedRows(along(at.task, motions), OUTPUTS), size);
    const scale = Math.max(GENERIC.outputScale, t.values[0] ?? 0);
    const driven = kept(place, "direct", {values: a.values, scale: 1, count: size - idle},
        PASSIVE.length - idle);
    const produced = kept(place, "inverse", {values: t.values, scale, count: PRODUCED},
        K_RANK + PRODUCED);
    const more = place.lost ? t.values.slice(PRODUCED).filter((x) => x > NEARNESS.NEAR * scale).length : 0;
    const ranks = {inputs: driven.rank, outputs: produced.rank + more, motions: size};
    const unseen = ranks.inputs === size ? 0
        : inCommon(a.right.slice(ranks.inputs), t.right.slice(ranks.outputs));
    ranks.together = size - unseen;
    const undriven = GENERIC.together > GENERIC.inputs;
    const direct = undriven ? {distance: 0, accuracy: place.accuracy} : driven.nearest;
    return {ranks, a, t, nearest: [direct, produced.nearest, held]};
}

/**
 * Kinds of singularity of a closed posture, some of "direct", "inverse", "constraint", and
 * Zlatanov's types, some of "RI", "RO", "II", "IO", "IIM", "RPM", with the `sigma` of each kind.
 * A posture is singular where a singular one lies within the accuracy to which it is known:
 * `distance` is that to the nearest one, infinite where none is near. null where q does not close.
 */
export function classify(q) {
    if (!finite(q, Q) || !(residual(q) < OPEN_ABOVE)) return null;
    const {ranks, a, t, nearest} = decided(Float64Array.from(q));
    const {inputs: r, outputs: s, together, motions} = ranks, {inputs: i, together: b} = GENERIC;
    const truths = (all) => Object.keys(all).filter((name) => all[name]);
    const [first] = [...nearest].sort((x, y) => x.distance - y.distance);
    return {
        kinds: truths({
            direct: motions - r > MOTIONS - b,
            inverse: s < PRODUCED,
            constraint: motions > MOTIONS,
        }),
        types: truths({
            RI: together - s > b - PRODUCED,
            RO: together > r,
            II: r < i,
            IO: s < PRODUCED,
            IIM: motions > MOTIONS,
            RPM: motions - together > MOTIONS - b,
        }),
        sigma: {
            direct: numberedValue(a.values, INPUT_V.length, b + motions - MOTIONS),
            inverse: numberedValue(t.values, OUTPUTS, PRODUCED),
        },
        distance: first.distance,
        accuracy: first.accuracy,
    };
}
