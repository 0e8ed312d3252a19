/* A linear delta along a circle, by its exported program alone.

       closedchain export linear_delta --c .
       cc -std=c99 -O2 -I. examples/delta_circle.c linear_delta.c -lm -o circle
       ./circle

   Every line is a moment: time [s], the three sliders [m], and their speeds [m/s]. A controller
   would send them to its drives instead. */
#include "linear_delta.h"

#include <math.h>
#include <stdio.h>

#define MOMENTS 500

static const double radius = 0.1, period = 2.0; /* m, s */

/* Speeds of the sliders for a velocity of the tip: map speeds = velocity, by Cramer's rule. */
static void speeds_for(double map[3][3], const double *velocity, double *speeds)
{
    double det[4]; /* of the map with a column replaced, and of the map itself */
    for (int k = 0; k < 4; ++k) {
        double a[3][3];
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) a[r][c] = c == k ? velocity[r] : map[r][c];
        det[k] = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                 a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                 a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    }
    for (int k = 0; k < 3; ++k) speeds[k] = det[k] / det[3];
}

int main(void)
{
    const double turn = 2.0 * acos(-1.0) / period;
    double q[LINEAR_DELTA_Q], pose[LINEAR_DELTA_POSE];
    double centre[LINEAR_DELTA_POSE], sliders[LINEAR_DELTA_INPUTS];

    for (int i = 0; i < LINEAR_DELTA_Q; ++i) q[i] = linear_delta_home[i];
    linear_delta_tip(q, centre);
    for (int i = 0; i < LINEAR_DELTA_POSE; ++i) pose[i] = centre[i];

    for (int k = 0; k <= MOMENTS; ++k) {
        const double t = period * k / MOMENTS;
        const double c = radius * cos(turn * t), s = radius * sin(turn * t);
        const double velocity[3] = {-turn * s, turn * c, 0};
        double speeds[LINEAR_DELTA_INPUTS];
        linear_delta_measures found;

        pose[0] = centre[0] + c;
        pose[1] = centre[1] + s;
        int code = linear_delta_inverse(pose, q, q); /* from where it is */
        if (code == LINEAR_DELTA_ARRIVED) code = linear_delta_measure(q, &found);
        if (code != LINEAR_DELTA_ARRIVED || linear_delta_within_limits(q) < 0) {
            fprintf(stderr, "stopped after %g s: %s\n", t, linear_delta_sentence(code));
            return 1;
        }
        linear_delta_inputs_of(q, sliders);
        speeds_for(found.twist_map, velocity, speeds);
        printf("%.3f %.6f %.6f %.6f %.6f %.6f %.6f\n", t, sliders[0], sliders[1], sliders[2],
               speeds[0], speeds[1], speeds[2]);
    }
    return 0;
}
