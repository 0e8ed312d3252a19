"""Closed forms of parallelogram robots, planar linkages and what is refused."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy
from linkage_text import Cut, J, urdf
from linkages import three_rrr

import closedchain as cc
from closedchain.robots import rpa3t

pytestmark = pytest.mark.slow
load = cache(cc.load)
closed_forms = cache(cc.symbolic_singularities)


def symbols(text: str) -> list[sympy.Symbol]:
    return [sympy.Symbol(name, real=True) for name in text.split()]


def evaluated(s: cc.SymbolicSingularities, expr: sympy.Expr, qs: list[np.ndarray]) -> np.ndarray:
    names = sorted(expr.free_symbols, key=str)
    function = sympy.lambdify(names, expr, "numpy")
    return np.array([float(function(*[s.values(q)[x] for x in names])) for q in qs])


def postures(m: cc.Mechanism, n: int, spread: float = 0.1) -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    found: list[np.ndarray] = []
    unit = m.column_scale[m.input_v]
    while len(found) < n:
        q = np.array(m.home)
        q[m.input_q] += spread * unit * rng.uniform(-1.0, 1.0, len(m.inputs))
        s = cc.close(m, q)
        if s.converged:
            found.append(s.q)
    return found


def proportional(one: np.ndarray, two: np.ndarray) -> float:
    """Factor between two columns; fails where there is none."""
    ratio = one / two
    assert np.ptp(ratio) < 1e-9 * abs(ratio[0])
    return float(ratio[0])


# -- linear Delta ---------------------------------------------------------------------------------


@pytest.mark.parametrize("sizes", [{}, {"a": 0.45, "b": 0.6, "c": 0.15, "t": 0.04}])
def test_linear_delta(sizes: dict[str, float]) -> None:
    """Jq is bhat_i.z; det Jx is the triple product of the rods' directions."""
    m = load("linear_delta", **sizes)
    s = closed_forms(m)
    qs = postures(m, 100)
    rods = np.array([[m.point(q, f"C{i}") - m.point(q, f"B{i}") for i in (1, 2, 3)] for q in qs])
    rods /= np.linalg.norm(rods, axis=2, keepdims=True)
    signs = []
    for i, leg in enumerate(s.legs):
        b, d = symbols(f"q_b{i + 1} q_d{i + 1}")
        assert sympy.expand(leg.levers[f"q{i + 1}"] ** 2 - (sympy.cos(b) * sympy.cos(d)) ** 2) == 0
        force = np.array([[e(q) for e in _functions(s, leg.force[f"q{i + 1}"])] for q in qs])
        sign = proportional(force[:, 2], rods[:, i, 2])
        assert abs(sign) == pytest.approx(1.0, abs=1e-10)
        assert np.abs(force - sign * rods[:, i]).max() < 1e-10
        lever = evaluated(s, leg.levers[f"q{i + 1}"], qs)
        assert np.abs(lever - sign * rods[:, i, 2]).max() < 1e-10
        assert {f.role for f in leg.lever_factors[f"q{i + 1}"]} == {"inverse"}
        signs.append(sign)
    triple = evaluated(s, s.det_Jx.expr, qs)
    assert proportional(triple, np.linalg.det(rods)) != 0.0
    assert {f.role for f in s.det_Jx.factors} <= {"direct", "scale"}
    assert not s.det_output.expr.free_symbols


def _functions(s: cc.SymbolicSingularities, vector: sympy.Matrix) -> list:
    return [lambda q, e=e: s.evaluate(e, q) for e in vector]


# -- rpa3t ----------------------------------------------------------------------------------------

RPA = {"l1": 0.32, "l2": 0.06, "l3": 0.36, "l4": 0.82, "l5": 0.09, "l6": 0.012, "l7": 0.055}


@pytest.mark.parametrize("sizes", [{}, RPA])
def test_rpa3t(sizes: dict[str, float]) -> None:
    """det A = 8 l7 sin(beta) kappa M and det B = -8 l3^3 s1 s2 s3, factor by factor."""
    m = load("rpa3t", **sizes)
    s = closed_forms(m)
    g = rpa3t.geometry(**sizes)
    qs = postures(m, 100)
    theta = np.array([m.input_values(q) for q in qs])
    beta = np.array([s.values(q)[symbols("q_R12")[0]] for q in qs])
    c1 = np.array([m.point(q, "C1") for q in qs])
    coordinates = np.column_stack([c1[:, 0], c1[:, 2], beta])
    f = rpa3t.factors(coordinates, theta, g)
    for name, wanted in (("theta1", f.s1), ("theta2", f.s2), ("theta3", f.s3)):
        (leg,) = [leg for leg in s.legs if name in leg.inputs]
        proportional(evaluated(s, leg.levers[name], qs), wanted)
    q_r12 = symbols("q_R12")[0]
    direct = {x.expr: x for x in s.det_Jx.factors if x.role == "direct"}
    assert len(direct) == 3
    assert sympy.sin(q_r12) in direct
    left = []
    for expr in direct:
        values = evaluated(s, expr, qs)
        for known in ("sin_beta", "kappa", "M"):
            if np.ptp(values / getattr(f, known)) < 1e-9 * abs((values / getattr(f, known))[0]):
                left.append(known)
    assert sorted(left) == ["M", "kappa", "sin_beta"]
    (drop,) = [x for x in s.det_Jx.factors if x.role == "constraint"]
    rod = drop.expr * sympy.cos(symbols("q_Ua2")[0])  # the rods' share across theta1's axis
    proportional(evaluated(s, rod, qs), f.drop)
    (output,) = [x for x in s.det_output.factors if x.role == "inverse"]
    assert output.expr == sympy.cos(q_r12)
    (pair,) = [x for x in direct.values() if "theta1, theta2" in x.meaning and "3" not in x.meaning]
    proportional(evaluated(s, pair.expr, qs), f.M)


STRETCHED = [
    ({"R12": 0.0}, "direct"),
    ({"R12": -np.pi / 2}, "inverse"),
    ({"R22": 0.0}, "inverse"),
    ({"Ua1": 0.0}, "inverse"),
]


@pytest.mark.parametrize(("fixed", "kind"), STRETCHED)
def test_rpa3t_factors_and_classify_agree(fixed: dict[str, float], kind: str) -> None:
    m = load("rpa3t")
    s = closed_forms(m)
    found = cc.close(m, fixed=fixed)
    assert found.converged, found.message
    factors = s.direct if kind == "direct" else s.inverse
    assert min(abs(s.evaluate(f.expr, found.q)) for f in factors) < 1e-12
    assert kind in cc.classify(m, found.q).kinds


def test_regular_postures_of_rpa3t_have_no_vanishing_factor() -> None:
    m = load("rpa3t")
    s = closed_forms(m)
    for q in postures(m, 20, 0.05):
        kinds = cc.classify(m, q).kinds
        assert not kinds
        assert min(abs(s.evaluate(f.expr, q)) for f in (*s.direct, *s.inverse)) > 1e-6


# -- planar linkages of our own -------------------------------------------------------------------


def test_planar_3_rrr_without_parameters() -> None:
    """Elbow angles decide; numbers stay exact."""
    m = three_rrr()
    s = closed_forms(m)
    for i, leg in enumerate(s.legs, 1):
        elbow = symbols(f"q_b{i}")[0]
        assert sympy.expand(leg.determinant - sympy.sin(elbow) / 25) == 0
        assert [f.role for f in leg.factors] == ["inverse"]
        assert "stretched or folded" in leg.factors[0].meaning
    qs = postures(m, 50)
    ratios = []
    for q in qs:
        lines = []
        for leg, name in zip(s.legs, m.inputs, strict=True):
            force = [s.evaluate(e, q) for e in leg.force[name]]
            assert np.linalg.norm(force) == pytest.approx(1.0, abs=1e-12)
            lines.append(force)
        jx = np.array(s.Jx.subs(s.values(q)), dtype=float)
        planar = np.linalg.det(jx[:, [0, 1, 5]])
        ratios.append(s.evaluate(s.det_Jx.expr, q) / planar)
        assert np.allclose(jx[:, :3], lines)
    assert np.ptp(ratios) < 1e-9
    assert abs(ratios[0]) == pytest.approx(1.0, abs=1e-9)


FIVE_BAR = """
<robot name="fivebar" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="base_half" default="0.15"/>
  <xacro:arg name="arm" default="0.2"/>
  <xacro:arg name="rod" default="0.3"/>
  <xacro:arg name="start" default="2.2"/>
  BODY
</robot>
"""


def five_bar(**sizes: float) -> cc.Mechanism:
    text = urdf(
        "x",
        [
            J("A", "base", "left", "${-$(arg base_half)} 0 0"),
            J("B", "left", "left_rod", "$(arg arm) 0 0"),
            J("tip_point", "left_rod", "tip", "$(arg rod) 0 0", type="fixed"),
            J("E", "base", "right", "$(arg base_half) 0 0"),
            J("D", "right", "right_rod", "$(arg arm) 0 0"),
        ],
        [Cut("C", "tip", "right_rod", "0 0 0", "$(arg rod) 0 0")],
        inputs={"q1": "A", "q2": "E"},
        home={"A": "$(arg start)", "B": -1.3, "E": 0.9, "D": 1.3},
        tip="tip",
        outputs="x y",
    )
    body = text.split(">", 1)[1].rsplit("<", 1)[0]
    return cc.load_urdf(FIVE_BAR.replace("BODY", body), **sizes)


@pytest.mark.parametrize("sizes", [{}, {"base_half": 0.17, "arm": 0.22, "rod": 0.27}])
def test_five_bar_with_named_sizes(sizes: dict[str, float]) -> None:
    """Type 1: sin of an elbow. Type 2: the rods are in line, sin of their angle."""
    m = five_bar(**sizes)
    s = closed_forms(m)
    b, d, arm = symbols("q_B q_D arm")
    inverse = {f.expr for f in s.inverse}
    assert inverse == {sympy.sin(b), sympy.sin(d)}
    qs = postures(m, 50)
    rods = [m.point(q, "tip") - m.point(q, "left_rod") for q in qs]
    others = [m.point(q, "tip") - m.point(q, "right_rod") for q in qs]
    between = np.array([np.cross(x, y)[2] for x, y in zip(rods, others, strict=True)])
    angle = symbols("q_C")[0]
    direct = [f.expr for f in s.direct]
    values = evaluated(s, direct[0], qs)
    assert len(direct) == 1
    proportional(values, between)
    assert angle not in direct[0].free_symbols or arm in s.legend
    assert s.values(m.home)[arm] == (sizes or {"arm": 0.2})["arm"]


# -- refusals -------------------------------------------------------------------------------------


def test_shared_coupler_is_refused() -> None:
    with pytest.raises(cc.ClosureError, match=r"do not decouple: .*passive1_R.*'coupler'"):
        cc.symbolic_singularities(load("d1"))


def test_without_task_refused() -> None:
    m = cc.load_urdf(urdf("arm", [J("A", "base", "left")]), xacro=False)
    with pytest.raises(cc.ClosureError, match="no task"):
        cc.symbolic_singularities(m)
