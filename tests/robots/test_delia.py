"""The DeLiA family: its members, the legs that make none, and closed forms against the loops."""

from __future__ import annotations

import itertools
import json
import re
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app
from closedchain.robots import d1 as d1_forms
from closedchain.robots import delia, families, family, robots
from closedchain.robots.d1 import Pose

MEMBERS = [tuple(choices.values()) for choices in family("delia").members()]
STAGE = ("RPS", "RRS", "PRS", "PPS")
OUTER = ("UPS", "URS", "CPS", "CRS", "RRPS", "RRRS")
EVERY_LEG = [("RPS", "PPS", "UPS"), ("RRS", "PRS", "URS"), ("PRS", "RRS", "CPS")]
EVERY_LEG += [("PPS", "RPS", "CRS"), ("RRS", "RRS", "RRPS"), ("PRS", "PPS", "RRRS")]


def load(member: tuple[str, str, str], **sizes: object) -> cc.Mechanism:
    coupler, passive, outer = member
    return cc.load("delia", coupler=coupler, passive=passive, outer=outer, **sizes)


def as_pose(placement: pin.SE3) -> Pose:
    return Pose(placement.rotation, placement.translation)


def joint_value(m: cc.Mechanism, q: np.ndarray, name: str) -> float:
    return float(q[m.model.joints[m.model.getJointId(name)].idx_q])


def wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def near_postures(m: cc.Mechanism, n: int, seed: int, spread: float = 0.012) -> list[np.ndarray]:
    """Closed postures near home; D1's nearest direct singularity is 0.049 m away in its inputs."""
    rng = np.random.default_rng(seed)
    home = m.input_values(m.home)
    arm = np.array([1.0 if unit == "m" else 3.0 for unit in m.input_units])
    steps = spread * arm * rng.uniform(-1.0, 1.0, (n, 6))
    return [cc.direct(m, home + step).raise_if_failed().q for step in steps]


# -- the family ----------------------------------------------------------------------------------


def test_the_family_is_one_entry_beside_the_robots() -> None:
    assert families() == ("delia",)
    assert "delia" not in robots()
    assert len(MEMBERS) == len(set(MEMBERS)) == 96
    assert set(MEMBERS) == set(itertools.product(STAGE, STAGE, OUTER))
    assert MEMBERS[0] == ("RPS", "RPS", "UPS")
    with pytest.raises(cc.DescriptionError, match="unknown family 'd1'; known: delia"):
        family("d1")


def test_the_default_member_is_d1(d1: cc.Mechanism) -> None:
    for m in (cc.load("delia"), load(("RPS", "RPS", "UPS"))):
        assert m.inputs == d1.inputs
        assert list(m.model.names) == list(d1.model.names)
        assert [c.name for c in m.closures] == [c.name for c in d1.closures]
        assert_close(m.home, d1.home, 0.0)
        assert m.length == d1.length
        for q in near_postures(d1, 3, seed=1):
            open_q = pin.integrate(d1.model, q, np.full(d1.model.nv, 0.05))
            assert_close(cc.residual(m, open_q), cc.residual(d1, open_q), 0.0)
            assert_close(m.input_values(q), d1.input_values(q), 0.0)
            assert_close(m.point(q, "T"), d1.point(q, "T"), 0.0)


@pytest.mark.parametrize("variant", ["printed_u", "circle_u"])
def test_variants_are_those_of_d1(variant: str) -> None:
    assert_close(cc.load("delia", variant=variant).home, cc.load("d1", variant=variant).home, 0.0)
    for outer in OUTER:  # feet that are not in line with their tips
        m = cc.load("delia", variant=variant, outer=outer)
        assert np.abs(cc.residual(m, m.home)).max() < 1e-12


@pytest.mark.parametrize("leg", ["SPS", "SRS", "SCS", "UCS", "RRCS", "CCS"])
def test_outer_legs_of_the_paper_with_idle_freedoms_are_refused(leg: str) -> None:
    freedoms = sum(delia.FREEDOMS[x] for x in leg.replace("RR", "U"))
    assert freedoms > 6
    with pytest.raises(cc.DescriptionError, match=f"'outer' cannot be '{leg}'.*{freedoms} freedom"):
        cc.load("delia", outer=leg)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"outer": "RUS"}, ("'outer'", "known: UPS, URS, CPS, CRS, RRPS, RRRS")),
        ({"coupler": "UPS"}, ("'coupler'", "did you mean 'RPS'")),
        ({"passive": "SPS"}, ("'passive'", "PPS")),
        ({"couplr": "RPS"}, ("unknown parameter 'couplr'", "did you mean 'coupler'")),
        ({"radius_S": -0.1}, ("radius_S", "above zero")),
        ({"outer_distal": 0}, ("outer_distal", "above zero")),
        ({"coupler": "RRS", "coupler_distal": 0.1}, ("leg1_S", "coupler_distal", "0.522")),
        ({"passive": "PRS", "passive_distal": 0.04}, ("passive1_S", "passive_distal", "0.045")),
        ({"outer": "URS", "outer_proximal": 0.08}, ("leg4_S", "outer_proximal", "0.546")),
        ({"outer": "RRRS", "outer_shoulder": 0.2}, ("leg4_S", "outer_shoulder")),
        ({"outer": "CRS", "outer_distal": 0.8}, ("leg4_S", "outer_distal")),
        ({"outer": "RRPS", "outer_shoulder": 0.6}, ("leg4_S", "outer_shoulder")),
    ],
)
def test_bad_parameters_are_named(parameters: dict[str, object], words: tuple[str, ...]) -> None:
    with pytest.raises(cc.DescriptionError) as caught:
        cc.load("delia", **parameters)
    for word in words:
        assert word in str(caught.value), str(caught.value)


def test_the_command_line_lists_and_loads_members() -> None:
    run = partial(CliRunner().invoke, app, catch_exceptions=False)
    lines = run(["list", "--family", "delia"]).stdout.splitlines()
    assert [tuple(line.split()[1:]) for line in lines[2:]] == MEMBERS
    listed = json.loads(run(["list", "--family", "delia", "--json"]).stdout)
    assert [tuple(entry["choices"].values()) for entry in listed] == MEMBERS
    assert listed[0]["choices"] == {"coupler": "RPS", "passive": "RPS", "outer": "UPS"}
    assert "delia" not in run(["list"]).stdout.split()
    words = ["info", "delia", "--set", "coupler=PRS", "--set", "outer=CPS", "--json"]
    found = json.loads(run(words).stdout)
    assert found["parameters"]["outer"] == "CPS"
    assert found["mobility"]["mobility"] == 6
    refused = run(["list", "--family", "d1"])
    assert (refused.exit_code, refused.stdout) == (1, "")
    assert "unknown family 'd1'; known: delia" in refused.stderr


# -- every member --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("coupler", STAGE)
def test_every_member_closes_has_six_freedoms_and_a_regular_home(coupler: str) -> None:
    for passive, outer in itertools.product(STAGE, OUTER):
        m = load((coupler, passive, outer))
        what = f"{coupler} {passive} {outer}"
        assert np.abs(cc.residual(m, m.home)).max() < 1e-12, what
        assert m.inputs == ("q1", "q2", "q3", "q4", "q5", "q6"), what
        found = cc.mobility(m)
        assert (found.gruebler, found.mobility, found.redundant_rows) == (6, 6, 0), what
        assert found.rank.above > 0.05, what
        home = cc.classify(m, m.home)
        # as for D1, the vertical tool loses the rotation about the base normal, whatever the legs
        assert home.kinds == {"inverse"}, what
        # input rates for joint rates of size 1, all joints counted: 0.137 for D1
        assert home.sigma_direct > 0.045, what
        assert_close(np.abs(home.lost_twists[:, 0]), [0, 0, 0, 0, 1, 0], 1e-10, what)


def test_a_pps_stage_must_not_be_driven_by_its_radial_slides() -> None:
    """With them locked, the three points could slide along their vertical guides together."""
    text = cc.load("delia", coupler="PPS").description.text
    radial = re.sub(r'(<joint name="leg\d_P)1"/>', r'\g<1>2"/>', text)
    m = cc.load_urdf(radial)
    assert [spec.joint for spec in m.description.inputs][:3] == ["leg1_P2", "leg2_P2", "leg3_P2"]
    found = cc.classify(m, m.home)
    assert "direct" in found.kinds
    assert cc.mobility(m).mobility == 6


@pytest.mark.parametrize("member", EVERY_LEG)
def test_every_leg_lets_the_platform_turn_in_six_ways(member: tuple[str, str, str]) -> None:
    """The paper calls the family robots of five degrees of freedom."""
    m = load(member)
    singular = [cc.classify(m, q).kinds for q in near_postures(m, 4, seed=2)]
    assert singular == [frozenset()] * 4


# -- closed forms --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("member", EVERY_LEG)
def test_closed_forms_read_the_joints_of_the_loops(
    member: tuple[str, str, str], tol: Tolerances
) -> None:
    m, closed_form = load(member), delia.Member(*member)
    found = near_postures(m, 170, seed=3)
    couplers = [as_pose(m.pose(q, "coupler")) for q in found]
    platforms = [as_pose(m.pose(q, "platform")) for q in found]
    batch = closed_form.joint_values(
        Pose(np.array([p.rotation for p in couplers]), np.array([p.position for p in couplers])),
        Pose(np.array([p.rotation for p in platforms]), np.array([p.position for p in platforms])),
    )
    assert batch.reachable.shape == (170,)
    assert batch.reachable.all()
    assert batch.inputs.shape == (170, 6)
    assert_close(batch.inputs, [m.input_values(q) for q in found], 1e-10)
    names = set(m.model.names) - {"universe", "coupler_pose", "platform_pose"}
    assert set(batch.joints) == names
    for name, values in batch.joints.items():
        off = [wrapped(joint_value(m, q, name) - v) for q, v in zip(found, values, strict=True)]
        assert_close(off, np.zeros(170), 1e-10, name)


@pytest.mark.parametrize("member", EVERY_LEG)
def test_the_inverse_problem_is_that_of_d1(member: tuple[str, str, str]) -> None:
    """Coupler poses depend on planes alone; one of D1's solutions is the posture itself."""
    m, closed_form = load(member), delia.Member(*member)
    for q in near_postures(m, 3, seed=4):
        solutions = d1_forms.inverse(as_pose(m.pose(q, "platform")), closed_form.geometry)
        assert solutions.complex_count == 12
        gaps = []
        for a in solutions.assemblies:
            values = closed_form.joint_values(a.coupler, a.platform)
            if values.reachable:
                gaps.append(np.abs(values.inputs - m.input_values(q)).max())
        assert min(gaps) < 1e-7  # torsion is small near home: a root is worth half its digits


@pytest.mark.parametrize("leg", [leg for leg in delia.DRIVEN if "RS" in leg])
def test_both_working_modes_reach_the_tip(leg: str) -> None:
    """Forward kinematics of the leg, written out, returns to the tip from both elbows."""
    rng = np.random.default_rng(5)
    tips = np.array([-0.2, -0.5, 0.0]) + rng.uniform(-0.05, 0.05, (200, 3))
    if leg in ("RRS", "PRS"):
        tips[:, 2] = 0.0
    sizes = delia.Sizes(0.06, 0.25, 0.4)
    elbows = []
    for mode in (-1, 1):
        found = delia.joint_values(leg, tips, sizes, mode=mode)
        assert found.reachable.all()
        assert_close(forward(leg, found.joints, sizes), tips, 1e-13, leg)
        elbows.append(found.joints[next(k for k in ("R3", "R2", "R") if k in found.joints)])
    assert np.abs(elbows[0] - elbows[1]).min() > 0.1


def forward(leg: str, j: dict[str, np.ndarray], sizes: delia.Sizes) -> np.ndarray:
    s, a, b = sizes.shoulder, sizes.proximal, sizes.distal
    zero = np.zeros_like(next(iter(j.values())))
    if leg == "PRS":
        return np.stack([b * np.cos(j["R"]), -j["P"] + b * np.sin(j["R"]), zero], axis=-1)
    first = j.get("R1", j.get("U1", j.get("C1")))
    elbow = j["R3"] if leg == "RRRS" else j["R2"] if leg == "RRS" else j["R"]
    tilt = j["R2"] if leg == "RRRS" else j.get("U2", zero)
    along, across = a + b * np.cos(elbow), b * np.sin(elbow)
    ahead = (s if leg == "RRRS" else 0.0) + along * np.cos(tilt)
    x = np.cos(first) * ahead - np.sin(first) * across
    y = np.sin(first) * ahead + np.cos(first) * across
    return np.stack([x, y, -along * np.sin(tilt) + j.get("C2", zero)], axis=-1)


@pytest.mark.parametrize("leg", ["RRS", "PRS", "URS", "CRS", "RRRS"])
def test_tips_out_of_reach_are_said_to_be_and_give_numbers(leg: str) -> None:
    far = np.array([[-0.2, -0.5, 0.0], [-1.5, -1.5, 0.3]])
    found = delia.joint_values(leg, far, delia.Sizes(0.06, 0.25, 0.4))
    assert found.reachable.tolist() == [True, False]
    assert all(np.isfinite(value).all() for value in found.joints.values())


def test_closed_forms_refuse_unknown_legs_and_modes() -> None:
    with pytest.raises(cc.DescriptionError, match="'outer' cannot be 'SPS'"):
        delia.Member(outer="SPS")
    with pytest.raises(cc.DescriptionError, match="'coupler'"):
        delia.Member(coupler="UPS")
    with pytest.raises(cc.DescriptionError, match="known: RPS, RRS"):
        delia.joint_values("RUS", np.zeros(3), delia.Sizes())
    with pytest.raises(cc.DescriptionError, match="proximal and distal links above zero"):
        delia.joint_values("RRS", np.zeros(3), delia.Sizes(distal=0.4))
    with pytest.raises(cc.DescriptionError, match="longer than its shoulder"):
        delia.joint_values("RRRS", np.zeros(3), delia.Sizes(0.3, 0.2, 0.4))
    with pytest.raises(cc.DescriptionError, match="-1 or \\+1"):
        delia.joint_values("RPS", np.zeros(3), delia.Sizes(), mode=0)
