"""Closed forms of Eclipse from its URDF: equations (17), (18) and (19) with the paper's names."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import sympy

import closedchain as cc
from closedchain.robots.eclipse import screws

pytestmark = pytest.mark.slow
load = cache(cc.load)
closed_forms = cache(cc.symbolic_singularities)
R, RG = sympy.symbols("r r_g", real=True)
SIZES = {"r_g": 0.23, "r": 0.15, "a": 0.11}


def symbols(text: str) -> list[sympy.Symbol]:
    return [sympy.Symbol(name, real=True) for name in text.split()]


def postures(m: cc.Mechanism, n: int) -> list[np.ndarray]:
    rng = np.random.default_rng(17)
    found: list[np.ndarray] = []
    while len(found) < n:
        q = np.array(m.home)
        q[m.input_q] += rng.uniform(-0.12, 0.12, len(m.inputs))
        s = cc.close(m, q)
        if s.converged:
            found.append(s.q)
    return found


def evaluated(s: cc.SymbolicSingularities, expr: sympy.Expr, qs: list[np.ndarray]) -> np.ndarray:
    names = sorted(expr.free_symbols, key=str)
    function = sympy.lambdify(names, expr, "numpy")
    return np.array([float(function(*[s.values(q)[x] for x in names])) for q in qs])


def numeric_screws(m: cc.Mechanism, q: np.ndarray, leg: str) -> np.ndarray:
    """Matrix of the leg's screws from Pinocchio's poses, hinges at the relative rotation found."""
    link, point = m.pose(q, f"{leg}_tip"), m.point(q, f"{leg}_tip")
    relative = link.rotation.T @ m.pose(q, f"S{leg}").rotation
    y = math.asin(relative[0, 2])
    x = math.atan2(-relative[1, 2], relative[2, 2])
    about_x = np.array([[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]])
    second = about_x @ [0.0, 1.0, 0.0]
    third = about_x @ [math.sin(y), 0.0, math.cos(y)]
    columns = [screws.revolute_screw(link.rotation @ e, point) for e in ([1, 0, 0], second, third)]
    found = cc.leg_velocity(m, q).legs["abc".index(leg)].screws[:3]
    return np.column_stack([*found, *columns])


def same(one: sympy.Expr, two: sympy.Expr) -> bool:
    return sympy.expand_trig(sympy.expand(one - two)).expand() == 0


def test_equation_17_by_name() -> None:
    s = closed_forms(load("eclipse"))
    for leg, which in zip(s.legs, "abc", strict=True):
        q_r, q_y = symbols(f"q_r{which} q_y{which}")
        printed = R * (-RG + R * sympy.cos(q_r)) * sympy.cos(q_y) * sympy.sin(q_r)
        assert same(leg.determinant, printed)
        roles = {f.expr: f.role for f in leg.factors}
        assert roles[sympy.cos(q_y)] == "representation"
        assert roles[sympy.sin(q_r)] == "inverse"
        assert roles[R] == "scale"
        (axis,) = [f for f in leg.factors if f.expr.has(RG)]
        assert axis.role == "inverse"
        assert f"{which}_S lies on the axis of th_{which}" in axis.meaning
        assert sum(f.exponent for f in leg.factors) == 4


def test_equation_18_by_name() -> None:
    s = closed_forms(load("eclipse2"))
    beta, q_r, q_y = symbols("beta_a q_ra q_ya")
    bracket = -RG * sympy.cos(beta) + R * sympy.cos(q_r + beta)
    printed = RG * R * bracket * sympy.cos(q_y) * sympy.sin(q_r)
    assert same(s.legs[0].determinant, printed)
    assert {f.role for f in s.legs[0].factors} == {"scale", "inverse", "representation"}
    meaning = next(f.meaning for f in s.legs[0].factors if f.expr == sympy.sin(q_r))
    assert "stretched or folded" in meaning
    q_rb, q_yb = symbols("q_rb q_yb")
    assert same(
        s.legs[1].determinant, R * (-RG + R * sympy.cos(q_rb)) * sympy.cos(q_yb) * sympy.sin(q_rb)
    )


def test_equation_19_is_representation() -> None:
    chain = closed_forms(load("eclipse")).virtual_chain
    assert chain is not None
    assert chain.expr == -sympy.cos(symbols("f_y")[0])
    assert [f.role for f in chain.factors] == ["representation"]


@pytest.mark.parametrize(
    ("robot", "sizes"), [("eclipse", {}), ("eclipse", SIZES), ("eclipse2", SIZES)]
)
def test_determinants_are_those_of_the_screws(robot: str, sizes: dict[str, float]) -> None:
    """With the sizes in force too, so that the parameters have their right names."""
    m = load(robot, **sizes)
    s = closed_forms(m)
    qs = postures(m, 100)
    for leg, which in zip(s.legs, "abc", strict=True):
        wanted = np.array([np.linalg.det(numeric_screws(m, q, which)) for q in qs])
        found = evaluated(s, leg.determinant, qs)
        assert np.abs(found - wanted).max() < 1e-10 * np.abs(wanted).max()
    for name, value in sizes.items():
        if sympy.Symbol(name, real=True) in s.legend:
            assert s.values(m.home)[sympy.Symbol(name, real=True)] == value


def test_forms_of_one_size_hold_for_another() -> None:
    """Named parameters: the expression of the default robot with the numbers of another one."""
    s, m = closed_forms(load("eclipse")), load("eclipse", **SIZES)
    other = closed_forms(m)
    for q in postures(m, 5):
        values = other.values(q)
        for leg, which in zip(s.legs, "abc", strict=True):
            wanted = np.linalg.det(numeric_screws(m, q, which))
            assert float(leg.determinant.subs(values)) == pytest.approx(wanted, rel=1e-10)


def test_velocity_equation() -> None:
    """Jx (v_O; omega) = Jq qdot for the motions of the mechanism."""
    m = load("eclipse", **SIZES)
    s = closed_forms(m)
    for q in postures(m, 5):
        at, values = cc.velocity(m, q), s.values(q)
        jx = np.array(s.Jx.subs(values), dtype=float)
        jq = np.array(s.Jq.subs(values), dtype=float)
        p = m.point(q, "P")
        twists = at.twist_map
        moved = twists.copy()
        moved[:3] += np.cross(p, twists[3:], axisb=0, axisc=0)  # v_O = v_P + p x omega
        assert np.abs(jx @ moved - jq).max() < 1e-10


def test_factors_vanish_where_classify_says() -> None:
    m = load("eclipse", **SIZES)
    s = closed_forms(m)
    physical = sympy.prod(f.expr for f in s.inverse)
    for q in postures(m, 30):
        assert abs(s.evaluate(physical, q)) > 1e-6
        assert "inverse" not in cc.classify(m, q).kinds
    for sizes, hinge, vanishing in (
        (SIZES, 0.0, sympy.sin(symbols("q_ra")[0])),
        (SIZES, math.pi, sympy.sin(symbols("q_ra")[0])),
        ({"r": 0.25}, math.acos(0.8), R * sympy.cos(symbols("q_ra")[0]) - RG),
    ):
        m = load("eclipse", **sizes)
        s = closed_forms(m)
        found = cc.close(m, fixed={"a_R": hinge})
        assert found.converged, found.message
        assert abs(s.evaluate(vanishing, found.q)) < 1e-12
        assert vanishing in [f.expr for f in s.inverse]
        assert "inverse" in cc.classify(m, found.q).kinds


def test_names_can_be_given() -> None:
    m = load("eclipse")
    s = cc.symbolic_singularities(m, names={"a_R": "alpha", "a_S.y": "wrist", "r": "link"})
    alpha, wrist, link = symbols("alpha wrist link")
    assert {alpha, wrist, link} <= s.legs[0].determinant.free_symbols
    with pytest.raises(cc.ClosureError, match="a_Q"):
        cc.symbolic_singularities(m, names={"a_Q": "x"})
    with pytest.raises(cc.ClosureError, match="one symbol"):
        cc.symbolic_singularities(m, names={"a_R": "x", "b_R": "x"})
    for unreadable in ("1x", "a b", "-x", "pi", "sin"):
        with pytest.raises(cc.ClosureError, match="is no symbol for 'a_R'"):
            cc.symbolic_singularities(m, names={"a_R": unreadable})


def test_report() -> None:
    s = closed_forms(load("eclipse"))
    assert "cos(q_ya) (representation)" in s.text
    assert r"\cos{\left(q_{ya} \right)}" in s.latex
    assert s.det_Jx.expr is None
    assert "terms" in s.det_Jx.note
