// == ALWAYS
function finite(x, count) {
    return x.length === count && Array.prototype.every.call(x, Number.isFinite);
}

// Repeat steps of Newton's method on a state until they end; the code of the ending.
function follow(step, judge, s, p) {
    const at = 2 * Q;
    while (s[at + EVALUATIONS] < MOST_STEPS) {
        step(s, p, MOST_STEPS - s[at + EVALUATIONS]);
        if (s[at + STATUS] >= 0) return Math.round(s[at + STATUS]);
        if (s[at + STATUS] <= ASKING) judge(s, p);
    }
    return ENDINGS.BUDGET.code;
}

function begun(states, from) {
    const s = new Float64Array(states);
    s.set(from);
    s.set(from, Q);
    s.set(FRESH, 2 * Q);
    return s;
}

// Answer for a state that has ended, `told` being what its posture says of itself.
function answer(s, code, told) {
    const reached = s[2 * Q + REACHED], e = ENDINGS;
    let how = Object.values(e).find((ending) => ending.code === code);
    if (reached < 0) how = how === e.SINGULAR ? e.SINGULAR_START : e.OPEN_START;
    else if (how === e.ARRIVED) {
        if (!(told[0] < CLOSED)) how = e.CONTRADICTION;
        else if (told[1] < 0) how = e.MIRRORED;
        else if (told[2] < 0) how = e.REVERSED;
    }
    return {
        q: s.slice(0, Q),
        converged: how === e.ARRIVED,
        ending: how.word,
        sentence: how.sentence,
        reached: Math.max(reached, 0),
        residual: told[0],
        withinLimits: told[3],
    };
}

function untried(guess) {
    const {word, sentence} = ENDINGS.UNTRIED;
    const q = guess && finite(guess, Q) ? Float64Array.from(guess) : Float64Array.from(home);
    const about = {residual: residual(q), withinLimits: withinLimits(q)};
    return {q, converged: false, ending: word, sentence, reached: 0, ...about};
}

/** Largest of all closure rows at q [m or rad]: how far the loops are from being closed. */
export function residual(q) {
    const told = new Float64Array(4);
    check(q, told);
    return told[0];
}

/** How far the joints are within their limits at q, at most 1; negative beyond [m or rad]. */
export function withinLimits(q) {
    const told = new Float64Array(4);
    check(q, told);
    return told[3];
}

/** Poses of the bodies behind all joints of the tree: axes x, y and z, then the origin [m]. */
export function bodies(q) {
    const found = new Float64Array(12 * BODIES);
    allBodies(q, found);
    return found;
}
// == DIRECT

/**
 * Direct position problem: the posture with given inputs, on the assembly branch of a guess.
 *
 * The inputs move on a straight line from those of the guess (home without one), in steps that
 * cannot pass a singularity unnoticed. Returns {q, converged, ending, sentence, reached, residual,
 * withinLimits}: the posture, or the last good one before the end, and why it ended.
 */
export function direct(inputs, guess = null) {
    const from = guess ?? home;
    if (!finite(inputs, INPUT_Q.length) || !finite(from, Q)) return untried(guess);
    return directFrom(INPUT_Q.map((i) => from[i]), inputs, from);
}

function directFrom(begin, inputs, from) {
    const s = begun(DIRECT_STATES, from), told = new Float64Array(4);
    const p = Float64Array.of(...begin, ...inputs, SMALLEST);
    const code = follow(direct_step, direct_judge, s, p);
    check(s, told);
    return answer(s, code, told);
}

/** Inputs at q. */
export function inputsOf(q) {
    return Float64Array.from(INPUT_Q, (i) => q[i]);
}
// == INVERSE

/**
 * Inverse position problem: a posture with the tip at a pose, on the branch of a guess.
 *
 * A pose is x y z [m] and a unit quaternion x y z w; components that are no outputs are not used.
 * The tip's origin moves on a straight line, its rotation about a fixed axis. Returns what `direct`
 * returns.
 */
export function inverse(pose, guess = null) {
    const from = guess ?? home;
    if (!finite(pose, POSE) || !finite(from, Q)) return untried(guess);
    const norm = Math.hypot(...Array.from(pose).slice(3));
    if (!(Math.abs(norm - 1) < 1e-3)) return untried(guess);
    return inverseFrom(tip(from), Float64Array.from(pose, (x, i) => (i < 3 ? x : x / norm)), from);
}

function inverseFrom(begin, pose, from) {
    const s = begun(INVERSE_STATES, from), told = new Float64Array(4);
    const p = Float64Array.of(...begin, ...pose, SMALLEST);
    const code = follow(inverse_step, inverse_judge, s, p);
    inverse_check(Float64Array.of(...s.subarray(0, Q), ...pose), told);
    return answer(s, code, told);
}

/** Pose of the tip in the world at q: x y z [m] and a unit quaternion x y z w. */
export function tip(q) {
    const found = new Float64Array(POSE);
    tipPose(q, found);
    return found;
}
// == MEASURE

// K = L U by Gaussian elimination with complete pivoting, in place; the order of the columns and
// the rank, at most the generic one.
function factors(a) {
    const order = Array.from({length: V}, (_, j) => j);
    let first = 0;
    for (let k = 0; k < K_RANK; ++k) {
        let best = 0, row = k, column = k;
        for (let i = k; i < ROWS; ++i)
            for (let j = k; j < V; ++j)
                if (Math.abs(a[i][j]) > best) [best, row, column] = [Math.abs(a[i][j]), i, j];
        if (k === 0) first = best;
        if (!(best > RANK_LOST * first)) return {order, rank: k};
        [a[k], a[row]] = [a[row], a[k]];
        for (const one of a) [one[k], one[column]] = [one[column], one[k]];
        [order[k], order[column]] = [order[column], order[k]];
        for (let i = k + 1; i < ROWS; ++i) {
            const factor = a[i][k] / a[k][k];
            a[i][k] = factor;
            for (let j = k + 1; j < V; ++j) a[i][j] -= factor * a[k][j];
        }
    }
    return {order, rank: K_RANK};
}

// Closed motions: a basis of ker K.
function kernel(a, {order, rank}) {
    return Array.from({length: V - rank}, (_, t) => {
        const x = new Float64Array(V);
        x[order[rank + t]] = 1;
        for (let k = rank - 1; k >= 0; --k) {
            let value = -a[k][rank + t];
            for (let j = k + 1; j < rank; ++j) value -= a[k][j] * x[order[j]];
            x[order[k]] = value / a[k][k];
        }
        return x;
    });
}

function inner(a, b) {
    let sum = 0;
    for (let i = 0; i < a.length; ++i) sum += a[i] * b[i];
    return sum;
}

const along = (m, motions) => motions.map((x) => Float64Array.from(m, (row) => inner(row, x)));
const inputsIn = (motions) => motions.map((x) => Float64Array.from(INPUT_V, (v) => x[v]));

// Make vectors y orthonormal (Gram and Schmidt, twice), and vectors x by the same steps.
function orthonormal(y, x) {
    const less = (a, b, share) => {
        for (let i = 0; i < a.length; ++i) a[i] -= share * b[i];
    };
    y.forEach((one, t) => {
        for (let s = 0; s < 2 * t; ++s) {
            const share = inner(one, y[s % t]);
            less(one, y[s % t], share);
            less(x[t], x[s % t], share);
        }
        const length = Math.sqrt(inner(one, one)), scale = length > 0 ? 1 / length : 0;
        for (const vector of [one, x[t]])
            for (let i = 0; i < vector.length; ++i) vector[i] *= scale;
    });
}

// Turn x and y by an angle of a tangent.
function turn(x, y, tangent) {
    const c = 1 / Math.sqrt(1 + tangent * tangent);
    for (let k = 0; k < x.length; ++k) {
        const kept = x[k];
        x[k] = c * (kept - tangent * y[k]);
        y[k] = c * (tangent * kept + y[k]);
    }
}

// Singular values of columns a, falling, by Jacobi's rotations from one side (Hestenes 1958);
// columns b turn along. Columns that are zero to rounding are turned no more.
function singularValues(a, b) {
    const none = a.reduce((sum, x) => sum + inner(x, x), 0) * (0.01 * EPSILON) ** 2;
    for (let sweep = 0, turned = true; turned && sweep < 40; ++sweep) {
        turned = false;
        for (let s = 0; s < a.length; ++s)
            for (let t = s + 1; t < a.length; ++t) {
                const r = inner(a[s], a[t]);
                if (r === 0) continue;
                const p = inner(a[s], a[s]), q = inner(a[t], a[t]);
                if (!(Math.min(p, q) > none && r * r > EPSILON * EPSILON * p * q)) continue;
                const z = (q - p) / (2 * r), w = 1 / (Math.abs(z) + Math.sqrt(1 + z * z));
                turn(a[s], a[t], z < 0 ? -w : w);
                if (b.length) turn(b[s], b[t], z < 0 ? -w : w);
                turned = true;
            }
    }
    const values = a.map((x) => Math.sqrt(inner(x, x)));
    const order = values.map((_, i) => i).sort((i, j) => values[j] - values[i]);
    for (const side of [values, a, b])
        if (side.length) side.splice(0, side.length, ...order.map((i) => side[i]));
    return values;
}

// Singular value by its number in falling order; 1 for none, 0 for one that is not there.
const numberedValue = (values, size, number) =>
    number === 0 ? 1 : number > Math.min(values.length, size) ? 0 : values[number - 1];

// Determinant of a square matrix, overwritten; largest pivot of each column.
function determinant(a) {
    let product = 1;
    for (let k = 0; k < a.length; ++k) {
        let best = k;
        for (let i = k + 1; i < a.length; ++i)
            if (Math.abs(a[i][k]) > Math.abs(a[best][k])) best = i;
        if (!(Math.abs(a[best][k]) > 0)) return 0;
        if (best !== k) {
            [a[k], a[best]] = [a[best], a[k]];
            product = -product;
        }
        product *= a[k][k];
        for (let i = k + 1; i < a.length; ++i) {
            const factor = a[i][k] / a[k][k];
            for (let j = k; j < a.length; ++j) a[i][j] -= factor * a[k][j];
        }
    }
    return product;
}

const copied = (rows) => rows.map((row) => Array.from(row));

// det K_p and det [K; J]; of redundant rows with the rows of K made independent.
function determinants(closures, task, lu, at) {
    if (ROWS === K_RANK) {
        const passive = closures.map((row) => PASSIVE.map((v) => row[v]));
        const whole = copied([...closures, ...task]);
        return {
            direct: DET_DIRECT ? determinant(passive) : null,
            inverse: DET_INVERSE ? determinant(whole) : null,
        };
    }
    const found = {direct: DET_DIRECT ? 0 : null, inverse: DET_INVERSE ? 0 : null};
    if (at.rank < K_RANK) return found;
    const lower = Array.from({length: K_RANK}, (_, i) =>
        lu.map((row, r) => (r < i ? 0 : r === i ? 1 : row[i])));
    const upper = Array.from({length: K_RANK}, (_, i) =>
        Array.from(lu[i], (x, j) => (j < i ? 0 : x / lu[i][i])));
    let volume = 1;
    for (const side of [lower, upper]) {
        const square = determinant(side.map((x) => side.map((y) => inner(x, y))));
        volume *= Math.sqrt(Math.max(square, 0));
    }
    for (let i = 0; i < K_RANK; ++i) volume *= Math.abs(lu[i][i]);
    const motions = kernel(lu, at);
    orthonormal(motions.map((x) => x.slice()), motions);
    if (DET_INVERSE) found.inverse = volume * determinant(along(task, motions));
    if (!DET_DIRECT) return {...found, inverse: DET_INVERSE ? Math.abs(found.inverse) : null};
    const side = ORDER * determinant(inputsIn(motions));
    found.direct = volume * Math.abs(side);
    if (side < 0 && DET_INVERSE) found.inverse = -found.inverse;
    return found;
}

// Closed motions at q, orthonormal in the norm of all joints' rates, and the inputs' rates in them.
function motionsAt(q) {
    if (!finite(q, Q) || !(residual(q) < OPEN_ABOVE)) return null;
    const flat = new Float64Array(MATRIX_ROWS * V);
    allMatrices(q, flat);
    const rows = Array.from({length: MATRIX_ROWS}, (_, i) =>
        Array.from(flat.subarray(i * V, (i + 1) * V)));
    const closures = rows.slice(0, ROWS), task = rows.slice(ROWS, FIRST_RATE);
    const first = FIRST_RATE, last = FIRST_RATE + RATES;
    const rates = rows.slice(first, last), loaded = rows.slice(last);
    const lu = copied(closures), at = factors(lu), count = V - at.rank;
    if (count > MOST_MOTIONS) return null;
    const motions = kernel(lu, at);
    orthonormal(along(rates, motions), motions);
    return {closures, task, loaded, lu, at, motions, driven: DRIVEN + count};
}

/**
 * First-order kinematics of a closed posture.
 *
 * Returns {known, twistMap, sigmaDirect, sigmaInverse, detDirect, detInverse}: whether the inputs
 * determine the tip's motion; rates of the outputs [m/s, rad/s] for rates of the inputs, a row for
 * each output (null where not known); the least singular values, zero at direct and inverse
 * singularities; determinants, whose signs and zeros mean something (null where there is none).
 * null where q is not closed, or where K loses more than six ranks.
 */
export function measure(q) {
    const found = motionsAt(q);
    if (found === null) return null;
    const {closures, task, lu, at, motions, driven} = found;
    const {direct: detDirect, inverse: detInverse} = determinants(closures, task, lu, at);
    const a = inputsIn(motions), t = along(task, motions);
    const produced = singularValues(t.map((x) => x.slice()), []);
    const sigmaInverse = numberedValue(produced, OUTPUTS, PRODUCED);
    const values = singularValues(a, t);
    const sigmaDirect = numberedValue(values, INPUT_V.length, driven);
    const known = sigmaDirect > RANK_LOST && driven <= motions.length;
    const entry = (o, i) => {
        let sum = 0;
        for (let k = 0; k < driven; ++k) sum += (t[k][o] / values[k]) * (a[k][i] / values[k]);
        return (sum * OUTPUT_UNIT[o]) / INPUT_UNIT[i];
    };
    const rowOf = (_, o) => INPUT_UNIT.map((_, i) => entry(o, i));
    const twistMap = known ? OUTPUT_UNIT.map(rowOf) : null;
    return {known, twistMap, sigmaDirect, sigmaInverse, detDirect, detInverse};
}

/**
 * Twist of the tip [m/s, rad/s], linear and angular, along the world's axes, for rates of the
 * inputs: six rows. null where the inputs do not determine it.
 */
export function tipMap(q) {
    const found = motionsAt(q);
    if (found === null) return null;
    const {loaded, motions, driven} = found, a = inputsIn(motions);
    const t = along(loaded.slice(0, 6), motions), values = singularValues(a, t);
    if (!(numberedValue(values, INPUT_V.length, driven) > RANK_LOST) || driven > motions.length)
        return null;
    return Array.from({length: 6}, (_, o) => INPUT_UNIT.map((unit, i) => {
        let sum = 0;
        for (let k = 0; k < driven; ++k) sum += (t[k][o] / values[k]) * (a[k][i] / values[k]);
        return sum / unit;
    }));
}

/**
 * Efforts of the inputs [N for slides, N m for angles] that hold a load at rest, joints without
 * friction. A wrench is force and moment [N, N m] on the robot at the tip's origin, along the
 * world's axes; `fall` the acceleration of free fall [m/s^2]. null where the inputs do not hold it.
 */
export function efforts(q, wrench = [0, 0, 0, 0, 0, 0], fall = [0, 0, FALL]) {
    const load = [...wrench, ...fall];
    const found = finite(load, 9) ? motionsAt(q) : null;
    if (found === null) return null;
    const {loaded, motions, driven} = found, a = inputsIn(motions);
    const works = along(loaded, motions).map((x) => [inner(load, x)]);
    const size = works.reduce((sum, [x]) => sum + Math.abs(x), 0);
    const values = singularValues(a, works);
    if (driven > motions.length) return null;
    if (!(numberedValue(values, INPUT_V.length, driven) > RANK_LOST)) return null;
    if (works.slice(driven).some(([x]) => Math.abs(x) > RANK_LOST * size)) return null;
    return Float64Array.from(INPUT_UNIT, (unit, i) => {
        let sum = 0;
        for (let k = 0; k < driven; ++k) sum += (works[k][0] / values[k]) * (a[k][i] / values[k]);
        return -sum / unit;
    });
}

const SMALLEST_HOP = 1e-3, LARGEST_HOP = 1, HOP = 1.6; // dimensionless

/**
 * The posture on the other side of a singularity nearby: with the same inputs for "direct", with
 * the tip at the same pose for "inverse". Found from guesses along the motion that needs least of
 * the inputs, or that moves the tip least, nearest first. Returns what `direct` returns, or null.
 */
export function across(q, way) {
    const found = motionsAt(q);
    if (found === null) return null;
    const isDirect = way === "direct", motions = found.motions;
    const a = isDirect ? inputsIn(motions) : along(found.task, motions);
    singularValues(a, motions);
    const least = motions[(isDirect ? found.driven : PRODUCED) - 1];
    if (least === undefined) return null;
    const given = isDirect ? inputsOf(q) : tip(q);
    const signed = isDirect ? DET_DIRECT && ROWS === K_RANK : DET_INVERSE;
    const side = (at) => {
        const told = measure(at);
        return Math.sign((isDirect ? told?.detDirect : told?.detInverse) ?? 0);
    };
    const here = side(q);
    const far = (at) => at.reduce((most, x, i) => Math.max(most, Math.abs(x - q[i])), 0);
    for (let size = SMALLEST_HOP; size <= LARGEST_HOP; size *= HOP)
        for (const hop of [size, -size]) {
            const guess = new Float64Array(Q);
            moved([...q, ...least.map((x) => hop * x)], guess);
            // closed where it is asked for: half way there the branches may have ended
            const other = (isDirect ? directFrom : inverseFrom)(given, given, guess);
            if (!other.converged) continue;
            const beyond = signed ? side(other.q) * here < 0 : far(other.q) > 0.5 * far(guess);
            if (beyond) return other;
        }
    return null;
}
