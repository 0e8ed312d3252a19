"""Position problems in C: the program that ``cc.export_code`` writes, compiled and timed in itself.

The courses are those of ``following``; here no Python stands between two steps.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.cases import STEP, Case
from benchmarks.following import BLOCK, DIRECT, Course, courses
from benchmarks.timing import OURS, Row

FLAGS = "-std=c99 -O3 -march=native"
LOOPS = 200  # runs through a course: the least of the blocks' means counts

MAIN = """
#include "robot.h"
#include <math.h>
#include <stdio.h>
#include <time.h>

#define COUNT %(count)d
#define SIZE %(size)d
static const double start[ROBOT_Q] = {%(start)s};
static const double targets[COUNT][SIZE] = {%(targets)s};

int main(void)
{
    double q[ROBOT_Q], pose[ROBOT_POSE], worst = 0, least = 1;
    for (int loop = 0; loop < %(loops)d; ++loop) {
        for (int i = 0; i < ROBOT_Q; ++i) q[i] = start[i];
        for (int k = 0; k + %(block)d <= COUNT; k += %(block)d) {
            struct timespec begin, end;
            clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
            for (int j = 0; j < %(block)d; ++j)
                if (robot_%(way)s(targets[k + j], q, q) != ROBOT_ARRIVED) return 1;
            clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
            const double took = end.tv_sec - begin.tv_sec + 1e-9 * (end.tv_nsec - begin.tv_nsec);
            if (took < least) least = took;
            if (loop == 0) worst = fmax(worst, robot_residual(q));
        }
    }
    robot_tip(q, pose);
    printf("%%.17g %%.17g", least / %(block)d, worst);
    printf(" %%.17g %%.17g %%.17g\\n", pose[0], pose[1], pose[2]);
    return 0;
}
"""


def rows(case: Case, repeats: int) -> Iterator[Row]:
    """Direct and inverse steps of a robot, in C."""
    m, q = case.start()
    for course in courses(case.robot, m, q, STEP, BLOCK * max(2, repeats // 100)):
        yield timed(m, q, course)


def timed(m: cc.Mechanism, q: np.ndarray, course: Course) -> Row:
    """Least mean time of a step over blocks, after a check of the postures at their ends."""
    about = (course.robot, f"{course.work}, exported to C", OURS)
    compiler = shutil.which("gcc")
    if compiler is None:
        return Row(*about, note="no gcc here")
    way = "direct" if course.work == DIRECT else "inverse"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in cc.export_code(m, "c", name="robot").items():
            (folder / file).write_text(text)
        (folder / "main.c").write_text(main(q, course, way))
        given = ["robot.c", "main.c", "-o", "timed", "-D_POSIX_C_SOURCE=199309L", "-lm"]
        subprocess.run([compiler, *FLAGS.split(), *given], cwd=folder, check=True, timeout=600)
        done = subprocess.run([folder / "timed"], capture_output=True, text=True, timeout=600)
    if done.returncode:
        return Row(*about, note="not solved")
    seconds, residual, *tip = map(float, done.stdout.split())
    error = float(np.linalg.norm(np.array(tip) - course.tips[-1]))
    return Row(*about, seconds, residual, error, FLAGS.partition(" ")[2])


def main(q: np.ndarray, course: Course, way: str) -> str:
    """Source that follows a course and prints time, residual and tip."""
    given = [t if way == "direct" else pin.SE3ToXYZQUAT(t) for t in course.targets]
    numbers = ", ".join("{" + ", ".join(repr(float(x)) for x in one) + "}" for one in given)
    return MAIN % {
        "count": len(given),
        "size": len(given[0]),
        "start": ", ".join(repr(float(x)) for x in q),
        "targets": numbers,
        "loops": LOOPS,
        "block": BLOCK,
        "way": way,
    }
