
int name_inverse(const name_real *pose, const name_real *guess, name_real *q)
{
    name_real s[NAME_INVERSE_STATES], p[2 * NAME_POSE + 1], given[NAME_Q + NAME_POSE], told[4];
    const name_real *from = guess ? guess : name_home;
    name_real square = 0;
    if (!name_finite(pose, NAME_POSE) || !name_finite(from, NAME_Q)) return NAME_UNTRIED;
    for (int i = 3; i < NAME_POSE; ++i) square += pose[i] * pose[i];
    if (!(name_abs(square - 1) < (name_real)1e-3)) return NAME_UNTRIED;
    name_begin(s, NAME_INVERSE_STATES, from);
    name_tip(from, p);
    for (int i = 0; i < NAME_POSE; ++i)
        p[NAME_POSE + i] = i < 3 ? pose[i] : pose[i] / name_sqrt(square);
    p[2 * NAME_POSE] = NAME_SMALLEST;
    const int code = name_follow(name_inverse_step, name_inverse_judge, s, p);
    for (int i = 0; i < NAME_Q; ++i) given[i] = q[i] = s[i];
    for (int i = 0; i < NAME_POSE; ++i) given[NAME_Q + i] = p[NAME_POSE + i];
    name_inverse_check(given, told);
    return name_ended(s, code, told);
}
