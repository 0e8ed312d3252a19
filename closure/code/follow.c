static int name_finite(const name_real *x, int count)
{
    for (int i = 0; i < count; ++i)
        if (!(name_abs(x[i]) <= NAME_LARGEST)) return 0;
    return 1;
}

typedef void (*name_loop)(name_real *s, const name_real *p, int most);

/* Repeat steps of Newton's method on a state until they end; the code of the ending. */
static int name_follow(name_loop step, name_loop judge, name_real *s, const name_real *p)
{
    name_real *state = s + 2 * NAME_Q;
    for (;;) {
        const int left = NAME_MOST_STEPS - (int)state[NAME_EVALUATIONS];
        if (left <= 0) return NAME_BUDGET;
        step(s, p, left);
        const name_real status = state[NAME_STATUS];
        if (status >= 0) return (int)(status + (name_real)0.5);
        if (status <= NAME_ASKING) judge(s, p, 1);
    }
}

static void name_begin(name_real *s, int states, const name_real *from)
{
    for (int i = 0; i < states; ++i) s[i] = 0;
    for (int i = 0; i < NAME_Q; ++i) s[i] = s[NAME_Q + i] = from[i];
    for (int i = 0; i < NAME_STATE; ++i) s[2 * NAME_Q + i] = name_fresh[i];
}

/* What is returned for a state that has ended, `told` being what its posture says of itself. */
static int name_ended(const name_real *s, int code, const name_real *told)
{
    if (s[2 * NAME_Q + NAME_REACHED] < 0)
        return code == NAME_SINGULAR ? NAME_SINGULAR_START : NAME_OPEN_START;
    if (code != NAME_ARRIVED) return code;
    if (!(told[0] < NAME_CLOSED)) return NAME_CONTRADICTION;
    if (told[1] < 0) return NAME_MIRRORED;
    if (told[2] < 0) return NAME_REVERSED;
    return NAME_ARRIVED;
}

name_real name_residual(const name_real *q)
{
    name_real told[4];
    name_check(q, told);
    return told[0];
}

name_real name_within_limits(const name_real *q)
{
    name_real told[4];
    name_check(q, told);
    return told[3];
}

const char *name_sentence(int code)
{
    switch (code) {
/* SENTENCES */
    default: return "no code of this program";
    }
}
