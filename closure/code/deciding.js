// The decision of `classify`: singular values far from zero count, those that are zero to rounding
// do not, and one in between is judged by how far the nearest singular posture is.

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
