
int name_direct(const name_real *inputs, const name_real *guess, name_real *q)
{
    name_real s[NAME_DIRECT_STATES], p[2 * NAME_INPUTS + 1], told[4];
    const name_real *from = guess ? guess : name_home;
    if (!name_finite(inputs, NAME_INPUTS) || !name_finite(from, NAME_Q)) return NAME_UNTRIED;
    name_begin(s, NAME_DIRECT_STATES, from);
    for (int i = 0; i < NAME_INPUTS; ++i) {
        p[i] = from[name_input_q[i]];
        p[NAME_INPUTS + i] = inputs[i];
    }
    p[2 * NAME_INPUTS] = NAME_SMALLEST;
    const int code = name_follow(name_direct_step, name_direct_judge, s, p);
    for (int i = 0; i < NAME_Q; ++i) q[i] = s[i];
    name_check(q, told);
    return name_ended(s, code, told);
}

void name_inputs_of(const name_real *q, name_real *inputs)
{
    for (int i = 0; i < NAME_INPUTS; ++i) inputs[i] = q[name_input_q[i]];
}
