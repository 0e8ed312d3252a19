/* Largest entry in size of what is left of a matrix, and its place. */
static name_real name_largest(const name_real *a, int begin, int *row, int *column)
{
    name_real best = 0;
    for (int i = begin; i < NAME_ROWS; ++i)
        for (int j = begin; j < NAME_V; ++j) {
            const name_real size = name_abs(a[i * NAME_V + j]);
            if (size > best) {
                best = size;
                *row = i;
                *column = j;
            }
        }
    return best;
}

static void name_swap(name_real *a, int first, int second, int step, int count)
{
    for (int k = 0; k < count; ++k) {
        const name_real kept = a[first + k * step];
        a[first + k * step] = a[second + k * step];
        a[second + k * step] = kept;
    }
}

/* K = L U by Gaussian elimination with complete pivoting, in place; columns[k] is the column that
   stands at k now. Returns the rank, at most the generic one. */
static int name_factors(name_real *a, int *columns)
{
    name_real first = 0;
    for (int j = 0; j < NAME_V; ++j) columns[j] = j;
    for (int k = 0; k < NAME_K_RANK; ++k) {
        int row = k, column = k;
        const name_real best = name_largest(a, k, &row, &column);
        if (k == 0) first = best;
        if (!(best > NAME_RANK_LOST * first)) return k;
        name_swap(a, k * NAME_V, row * NAME_V, 1, NAME_V);
        name_swap(a, k, column, NAME_V, NAME_ROWS);
        const int kept = columns[k];
        columns[k] = columns[column];
        columns[column] = kept;
        for (int i = k + 1; i < NAME_ROWS; ++i) {
            const name_real factor = a[i * NAME_V + k] / a[k * NAME_V + k];
            a[i * NAME_V + k] = factor;
            for (int j = k + 1; j < NAME_V; ++j) a[i * NAME_V + j] -= factor * a[k * NAME_V + j];
        }
    }
    return NAME_K_RANK;
}

/* Closed motions: a basis of ker K, one after the other in rows of n. */
static void name_kernel(const name_real *a, const int *columns, int rank, name_real *n)
{
    for (int t = 0; t < NAME_V - rank; ++t) {
        name_real *x = n + t * NAME_V;
        for (int j = 0; j < NAME_V; ++j) x[j] = 0;
        x[columns[rank + t]] = 1;
        for (int k = rank - 1; k >= 0; --k) {
            name_real value = -a[k * NAME_V + rank + t];
            for (int j = k + 1; j < rank; ++j) value -= a[k * NAME_V + j] * x[columns[j]];
            x[columns[k]] = value / a[k * NAME_V + k];
        }
    }
}

/* Rows of y for rows of x: y = x m^T, with m of `rows` rows of V numbers. */
static void name_along(const name_real *m, int rows, const name_real *x, int count, name_real *y)
{
    for (int t = 0; t < count; ++t)
        for (int r = 0; r < rows; ++r) {
            name_real sum = 0;
            for (int v = 0; v < NAME_V; ++v) sum += m[r * NAME_V + v] * x[t * NAME_V + v];
            y[t * rows + r] = sum;
        }
}

static name_real name_inner(const name_real *a, const name_real *b, int size)
{
    name_real sum = 0;
    for (int i = 0; i < size; ++i) sum += a[i] * b[i];
    return sum;
}

/* Make rows of y orthonormal (Gram and Schmidt, twice), and rows of x by the same steps. */
static void name_orthonormal(name_real *y, int size, name_real *x, int count)
{
    for (int t = 0; t < count; ++t) {
        for (int s = 0; s < 2 * t; ++s) {
            const int u = s % t;
            const name_real share = name_inner(y + t * size, y + u * size, size);
            for (int i = 0; i < size; ++i) y[t * size + i] -= share * y[u * size + i];
            for (int v = 0; v < NAME_V; ++v) x[t * NAME_V + v] -= share * x[u * NAME_V + v];
        }
        const name_real length = name_sqrt(name_inner(y + t * size, y + t * size, size));
        const name_real scale = length > 0 ? 1 / length : 0;
        for (int i = 0; i < size; ++i) y[t * size + i] *= scale;
        for (int v = 0; v < NAME_V; ++v) x[t * NAME_V + v] *= scale;
    }
}

/* Singular values of rows of a, falling, by Jacobi's rotations from one side (Hestenes 1958); rows
   of b turn along. */
static void name_singular_values(name_real *a, int size, name_real *b, int beside, int count,
                                 name_real *values)
{
    for (int sweep = 0; sweep < 40; ++sweep) {
        int turned = 0;
        for (int s = 0; s < count; ++s)
            for (int t = s + 1; t < count; ++t) {
                name_real *first = a + s * size, *second = a + t * size;
                const name_real p = name_inner(first, first, size);
                const name_real q = name_inner(second, second, size);
                const name_real r = name_inner(first, second, size);
                if (!(name_abs(r) > NAME_EPSILON * name_sqrt(p) * name_sqrt(q))) continue;
                const name_real z = (q - p) / (2 * r);
                const name_real w = 1 / (name_abs(z) + name_sqrt(1 + z * z));
                const name_real tangent = z < 0 ? -w : w;
                const name_real c = 1 / name_sqrt(1 + tangent * tangent), d = c * tangent;
                for (int k = 0; k < size + beside; ++k) {
                    name_real *x = k < size ? first + k : b + s * beside + k - size;
                    name_real *y = k < size ? second + k : b + t * beside + k - size;
                    const name_real kept = *x;
                    *x = c * kept - d * *y;
                    *y = d * kept + c * *y;
                }
                turned = 1;
            }
        if (!turned) break;
    }
    for (int s = 0; s < count; ++s) {
        const name_real *one = a + s * size;
        values[s] = name_sqrt(name_inner(one, one, size));
    }
    for (int s = 0; s < count; ++s) {
        int best = s;
        for (int t = s + 1; t < count; ++t)
            if (values[t] > values[best]) best = t;
        name_swap(values, s, best, 1, 1);
        name_swap(a, s * size, best * size, 1, size);
        name_swap(b, s * beside, best * beside, 1, beside);
    }
}

/* Singular value by its number in falling order; 1 for none, 0 for one that is not there. */
static name_real name_value(const name_real *values, int count, int number)
{
    return number == 0 ? 1 : number > count ? 0 : values[number - 1];
}

#if NAME_DET_DIRECT || NAME_DET_INVERSE
/* Determinant of a square matrix, overwritten; largest pivot of each column. */
static name_real name_determinant(name_real *a, int size)
{
    name_real product = 1;
    for (int k = 0; k < size; ++k) {
        int best = k;
        for (int i = k + 1; i < size; ++i)
            if (name_abs(a[i * size + k]) > name_abs(a[best * size + k])) best = i;
        const name_real pivot = a[best * size + k];
        if (!(name_abs(pivot) > 0)) return 0;
        if (best != k) {
            name_swap(a, k * size, best * size, 1, size);
            product = -product;
        }
        product *= pivot;
        for (int i = k + 1; i < size; ++i) {
            const name_real factor = a[i * size + k] / pivot;
            for (int j = k; j < size; ++j) a[i * size + j] -= factor * a[k * size + j];
        }
    }
    return product;
}

#if NAME_ROWS == NAME_K_RANK
/* det K_p, and det [K; J], of the matrices themselves. */
static void name_determinants(name_work *w, name_measures *found)
{
#if NAME_DET_DIRECT
    for (int r = 0; r < NAME_ROWS; ++r)
        for (int j = 0; j < NAME_K_RANK; ++j)
            w->square[r * NAME_K_RANK + j] = w->k[r * NAME_V + name_passive[j]];
    found->det_direct = name_determinant(w->square, NAME_K_RANK);
#endif
#if NAME_DET_INVERSE
    for (int i = 0; i < NAME_V * NAME_V; ++i) w->square[i] = w->k[i];
    found->det_inverse = name_determinant(w->square, NAME_V);
#endif
    (void)w;
    (void)found;
}
#else
/* Square root of the determinant of a Gram matrix, of `count` rows: their volume. */
static name_real name_volume(name_real *gram, int count)
{
    const name_real square = name_determinant(gram, count);
    return square > 0 ? name_sqrt(square) : 0;
}

/* Of redundant rows: with the rows of K made independent, whatever combines them. */
static void name_determinants(name_work *w, name_measures *found)
{
    name_real volume = 1;
    if (w->rank < NAME_K_RANK) return;
    for (int i = 0; i < NAME_K_RANK; ++i)
        for (int j = 0; j < NAME_K_RANK; ++j) {
            name_real sum = 0;
            for (int r = 0; r < NAME_ROWS; ++r) {
                const name_real x = r < i ? 0 : r == i ? 1 : w->lu[r * NAME_V + i];
                const name_real y = r < j ? 0 : r == j ? 1 : w->lu[r * NAME_V + j];
                sum += x * y;
            }
            w->square[i * NAME_K_RANK + j] = sum;
        }
    volume *= name_volume(w->square, NAME_K_RANK);
    for (int i = 0; i < NAME_K_RANK; ++i)
        for (int j = 0; j < NAME_K_RANK; ++j) {
            name_real sum = 0;
            const name_real *x = w->lu + i * NAME_V, *y = w->lu + j * NAME_V;
            for (int v = i > j ? i : j; v < NAME_V; ++v) sum += (x[v] / x[i]) * (y[v] / y[j]);
            w->square[i * NAME_K_RANK + j] = sum;
        }
    volume *= name_volume(w->square, NAME_K_RANK);
    for (int i = 0; i < NAME_K_RANK; ++i) volume *= name_abs(w->lu[i * NAME_V + i]);
    name_kernel(w->lu, w->columns, w->rank, w->n);
    for (int i = 0; i < NAME_MOTIONS * NAME_V; ++i) w->y[i] = w->n[i];
    name_orthonormal(w->y, NAME_V, w->n, NAME_MOTIONS);
#if NAME_DET_INVERSE
    name_along(w->k + NAME_ROWS * NAME_V, NAME_OUTPUTS, w->n, NAME_MOTIONS, w->square);
    found->det_inverse = volume * name_determinant(w->square, NAME_MOTIONS);
#endif
#if NAME_DET_DIRECT
    for (int t = 0; t < NAME_MOTIONS; ++t)
        for (int i = 0; i < NAME_INPUTS; ++i)
            w->square[t * NAME_INPUTS + i] = w->n[t * NAME_V + name_input_v[i]];
    const name_real side = NAME_ORDER * name_determinant(w->square, NAME_MOTIONS);
    found->det_direct = volume * name_abs(side);
    if (side < 0) found->det_inverse = -found->det_inverse;
#else
    found->det_inverse = name_abs(found->det_inverse);
#endif
}
#endif
#else
static void name_determinants(const name_work *w, const name_measures *found)
{
    (void)w, (void)found;
}
#endif

/* Closed motions at q, orthonormal in the norm of all joints' rates, and the inputs' rates in them.
   Determinants are told along the way where `found` is not 0. */
static int name_motions(const name_real *q, name_work *w, name_measures *found)
{
    name_real told[4];
    if (!name_finite(q, NAME_Q)) return NAME_UNTRIED;
    name_check(q, told);
    if (!(told[0] < NAME_OPEN_ABOVE)) return NAME_OPEN;
    name_matrices(q, w->k);
    for (int i = 0; i < NAME_ROWS * NAME_V; ++i) w->lu[i] = w->k[i];
    w->rank = name_factors(w->lu, w->columns);
    w->count = NAME_V - w->rank;
    w->driven = NAME_DRIVEN + w->count;
    if (w->count > NAME_MOST_MOTIONS) return NAME_DEGENERATE;
    if (found) name_determinants(w, found);
    name_kernel(w->lu, w->columns, w->rank, w->n);
    name_along(w->k + NAME_P * NAME_V, NAME_RATES, w->n, w->count, w->y);
    name_orthonormal(w->y, NAME_RATES, w->n, w->count);
    for (int t = 0; t < w->count; ++t)
        for (int i = 0; i < NAME_INPUTS; ++i)
            w->a[t * NAME_INPUTS + i] = w->n[t * NAME_V + name_input_v[i]];
    return NAME_ARRIVED;
}

/* Least singular value of the inputs' rates; `b`, `beside` numbers for a motion, turns along. */
static name_real name_sigma_direct(name_work *w, name_real *b, int beside, name_real *values)
{
    const int most = w->count < NAME_INPUTS ? w->count : NAME_INPUTS;
    name_singular_values(w->a, NAME_INPUTS, b, beside, w->count, values);
    return w->driven > w->count ? 0 : name_value(values, most, w->driven);
}

int name_measure(const name_real *q, name_measures *found)
{
    name_work work, *w = &work;
    name_real values[NAME_MOST_MOTIONS];
    const name_measures none = {0};
    *found = none;
    const int code = name_motions(q, w, found);
    if (code != NAME_ARRIVED) return code;
    const int count = w->count;
    name_along(w->k + NAME_ROWS * NAME_V, NAME_OUTPUTS, w->n, count, w->t);
    for (int i = 0; i < count * NAME_OUTPUTS; ++i) w->b[i] = w->t[i];
    name_singular_values(w->b, NAME_OUTPUTS, w->y, 0, count, values);
    found->sigma_inverse =
        name_value(values, count < NAME_OUTPUTS ? count : NAME_OUTPUTS, NAME_PRODUCED);
    found->sigma_direct = name_sigma_direct(w, w->t, NAME_OUTPUTS, values);
    if (!(found->sigma_direct > NAME_RANK_LOST)) return NAME_SINGULAR;
    for (int o = 0; o < NAME_OUTPUTS; ++o)
        for (int i = 0; i < NAME_INPUTS; ++i) {
            name_real sum = 0;
            for (int t = 0; t < w->driven; ++t) {
                const name_real *a = w->a + t * NAME_INPUTS, *b = w->t + t * NAME_OUTPUTS;
                sum += b[o] / values[t] * (a[i] / values[t]);
            }
            found->twist_map[o][i] = sum * name_output_unit[o] / name_input_unit[i];
        }
    return NAME_ARRIVED;
}

int name_efforts(const name_real *q, const name_real *wrench, const name_real *fall,
                 name_real *efforts)
{
    name_work work, *w = &work;
    name_real values[NAME_MOST_MOTIONS], works[NAME_MOST_MOTIONS], size = 0;
    name_real load[9] = {0, 0, 0, 0, 0, 0, 0, 0, NAME_FALL};
    for (int i = 0; i < 9; ++i) {
        if (i < 6 && wrench) load[i] = wrench[i];
        if (i > 5 && fall) load[i] = fall[i - 6];
    }
    for (int i = 0; i < NAME_INPUTS; ++i) efforts[i] = 0;
    if (!name_finite(load, 9)) return NAME_UNTRIED;
    const int code = name_motions(q, w, 0);
    if (code != NAME_ARRIVED) return code;
    for (int t = 0; t < w->count; ++t) {
        works[t] = 0;
        for (int i = 0; i < 9; ++i)
            works[t] += load[i] * name_inner(w->k + (NAME_P + NAME_RATES + i) * NAME_V,
                                             w->n + t * NAME_V, NAME_V);
        size += name_abs(works[t]);
    }
    if (!(name_sigma_direct(w, works, 1, values) > NAME_RANK_LOST)) return NAME_SINGULAR;
    for (int t = w->driven; t < w->count; ++t)
        if (name_abs(works[t]) > NAME_RANK_LOST * size) return NAME_SINGULAR;
    for (int i = 0; i < NAME_INPUTS; ++i) {
        name_real sum = 0;
        for (int t = 0; t < w->driven; ++t)
            sum += works[t] / values[t] * (w->a[t * NAME_INPUTS + i] / values[t]);
        efforts[i] = -sum / name_input_unit[i];
    }
    return NAME_ARRIVED;
}
