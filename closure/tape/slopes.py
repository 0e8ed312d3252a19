"""Slopes along motions: derivatives by the numbers of q, turned into ones by its tangent."""

from __future__ import annotations

from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.derivative import gradient
from closedchain.closure.tape.expression import Expr, Tape, total
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.vectors import matvec, rotation, transposed


def slopes_of_product(k: Kinematics, rows: list[Entries], *, own: bool = True) -> Tape:
    """From q, left (rows,) and right (nv,) to the derivative (nv,) of left^T rows right.

    ``left`` and ``right`` are held. Along dimensionless steps, see ``along_motions``.
    """
    g, nq, nv = k.graph, k.mechanism.model.nq, k.mechanism.model.nv
    left, right = g.inputs(nq, len(rows)), g.inputs(nq + len(rows), nv)
    product = total(
        weight * g.lift(total(entry * right[v] for v, entry in row.items()))
        for weight, row in zip(left, rows, strict=True)
    )
    by_q = gradient(g, g.lift(product), range(nq))
    return g.tape(along_motions(k, by_q, own=own), nq + len(rows) + nv)


def along_motions(k: Kinematics, by_q: list[Expr], *, own: bool = True) -> list[Expr]:
    """Derivatives by dimensionless steps, from those by the numbers of q.

    Floating joints step along the body's own axes, as in Pinocchio's v, or along those of the frame
    that they float in.
    """
    model, scale = k.mechanism.model, k.mechanism.column_scale
    found: list[Expr] = []
    for i in range(1, model.njoints):
        iq = model.idx_qs[i]
        if model.nvs[i] == 1:
            found.append(float(scale[model.idx_vs[i]]) * by_q[iq])
            continue
        turn = (k.q[iq + 3], k.q[iq + 4], k.q[iq + 5], k.q[iq + 6])
        place = [k.mechanism.length * slope for slope in by_q[iq : iq + 3]]
        found += matvec(transposed(rotation(turn)), place) if own else place
        found += _by_turns(turn, by_q[iq + 3 : iq + 7], 1.0 if own else -1.0)
    return found


def _by_turns(turn: tuple[Expr, ...], by_quaternion: list[Expr], side: float) -> list[Expr]:
    """Derivatives by turns about the body's own axes (side 1) or the outer ones (side -1).

    A turn r changes the quaternion by half its product with (r, 0), from the right or the left.
    """
    x, y, z, w = turn
    a, b, c, d = (0.5 * slope for slope in by_quaternion)
    return [
        w * a - x * d + side * (z * b - y * c),
        w * b - y * d + side * (x * c - z * a),
        w * c - z * d + side * (y * a - x * b),
    ]
