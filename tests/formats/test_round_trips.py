"""Out and in again: mobility, home, kinds and points of every robot and of every closure kind."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from mujoco_side import at, opening, qpos_of, worst_pose
from one_closure import mechanism

import closedchain as cc
from closedchain.urdf import CLOSURE_TYPES, DescriptionError

FORMATS = ("urdf", "urdf+", "robot.yaml", "mjcf", "sdf")


def out_and_in(m: cc.Mechanism, form: str, folder: Path) -> tuple[cc.Mechanism, tuple[str, ...]]:
    if form == "mjcf":
        pytest.importorskip("mujoco")
    file = folder / ("robot.yaml" if form == "robot.yaml" else "robot.xml")
    text, losses = cc.export(m, form, file)
    assert file.read_text() == text
    return cc.load_file(file), losses


def home_values(m: cc.Mechanism) -> dict[str, np.ndarray]:
    joints = list(zip(m.model.names, m.model.joints, strict=True))[1:]
    return {name: m.home[j.idx_q : j.idx_q + j.nq] for name, j in joints}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("name", cc.robots("papers"))
def test_every_robot(name: str, form: str, tmp_path: Path) -> None:
    m = cc.load(name)
    again, losses = out_and_in(m, form, tmp_path)
    assert all(sentence.strip() and "\n" not in sentence for sentence in losses)
    assert sorted((c.name, c.kind) for c in again.closures) == sorted(
        (c.name, c.kind) for c in m.closures
    )
    assert cc.mobility(again).mobility == cc.mobility(m).mobility
    assert again.inputs == m.inputs
    assert again.task == m.task
    assert again.length == pytest.approx(m.length, rel=1e-12)
    assert list(again.postures) == list(m.postures)
    mine, theirs = home_values(m), home_values(again)
    for joint, values in mine.items():
        assert_close(theirs[joint], values, 1e-9, joint)
    for frame in m.frame_ids:
        assert_close(again.point(again.home, frame), m.point(m.home, frame), 1e-9, frame)
    inputs = m.input_values(m.home) + 0.01
    s, t = cc.direct(m, inputs).raise_if_failed(), cc.direct(again, inputs).raise_if_failed()
    tip = m.required_task().tip
    assert_close(again.point(t.q, tip), m.point(s.q, tip), 1e-9, tip)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("kind", CLOSURE_TYPES)
def test_every_kind_of_closure(kind: str, form: str, tmp_path: Path) -> None:
    """What a format lacks is written with empty links on joints: the same motions are left."""
    m = mechanism(kind)
    again, losses = out_and_in(m, form, tmp_path)
    assert not again.home_open
    assert cc.mobility(again).mobility == cc.mobility(m).mobility
    assert_close(again.point(again.home, "tip"), m.point(m.home, "tip"), 1e-9)
    own = {
        "urdf": CLOSURE_TYPES,
        "urdf+": CLOSURE_TYPES,
        "robot.yaml": ("fixed", "spherical", "revolute", "prismatic"),
        "mjcf": ("fixed", "spherical", "revolute", "distance"),
        "sdf": ("fixed", "spherical", "revolute", "prismatic", "universal"),
    }[form]
    assert ([c.kind for c in again.closures] == [kind]) == (kind in own)
    if kind not in own:
        assert any("'c'" in sentence and "empty" in sentence for sentence in losses)


@pytest.mark.parametrize("kind", CLOSURE_TYPES)
def test_every_kind_of_closure_in_mujoco(kind: str, tmp_path: Path) -> None:
    """MuJoCo's own Jacobian leaves as many freedoms, and its constraints hold at home."""
    mujoco = pytest.importorskip("mujoco")
    m = mechanism(kind)
    text, _ = cc.export(m, "mjcf")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = at(model, model.qpos0)
    assert opening(data) < 1e-12
    jacobian = np.array(data.efc_J).reshape(-1, model.nv)[: data.ne]
    singular = np.linalg.svd(jacobian, compute_uv=False)
    rank = int((singular > 1e-9 * singular[0]).sum())
    assert model.nv - rank == cc.mobility(m).mobility


RELATIONS = {
    "linear": '<constraint name="k" type="linear" offset="0.2"><joint name="a"/>'
    '<joint name="b" multiplier="-2"/><joint name="c" multiplier="0.5"/></constraint>',
    "polynomial": '<constraint name="k" type="polynomial" polycoef="0.02 0.1 0.3">'
    '<follower joint="c"/><leader joint="a"/></constraint>',
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("relation", RELATIONS)
def test_relations_of_joint_values(relation: str, form: str, tmp_path: Path) -> None:
    limit = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>{limit}</joint>'
        for name, kind, parent in (
            ("a", "revolute", "base"), ("b", "revolute", "a"), ("c", "prismatic", "b"),
        )
    )  # fmt: skip
    m = cc.load_urdf(
        '<robot name="r"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>'
        f"{joints}{RELATIONS[relation]}"
        '<group_state name="home"><joint name="a" value="0.4"/></group_state></robot>'
    )
    again, _ = out_and_in(m, form, tmp_path)
    assert [(c.name, c.kind) for c in again.closures] == [("k", relation)]
    assert_close(again.home, m.home, 1e-9)
    for q in np.random.default_rng(0).uniform(-1, 1, (4, 3)):
        assert_close(cc.residual(again, q), cc.residual(m, q), 1e-12)


@pytest.mark.parametrize("form", FORMATS)
def test_rounded_numbers_go_out_as_the_exact_ones(form: str, tmp_path: Path) -> None:
    """Parallelograms in a general direction, to six digits: written, they need no mending."""
    text, _ = cc.export(cc.load("linear_delta"), "urdf")
    tilted = text.replace(
        '<link name="base"',
        '<link name="ground"/><joint name="tilt" type="fixed"><parent link="ground"/>'
        '<child link="base"/><origin rpy="0.3 0.5 0.7"/></joint><link name="base"',
    )
    rounded = re.sub(
        r'(xyz|rpy)="([^"]*)"',
        lambda match: f'{match[1]}="{" ".join(f"{float(x):.6g}" for x in match[2].split())}"',
        tilted,
    )
    m = cc.load_urdf(rounded)
    again, _ = out_and_in(m, form, tmp_path)
    assert cc.mobility(again).mobility == 3
    assert again.misfit < 1e-10
    tip = m.required_task().tip
    assert_close(again.point(again.home, tip), m.point(m.home, tip), 1e-9)


@pytest.mark.parametrize("form", FORMATS)
def test_what_resists_a_motion_and_what_drives_it(form: str, tmp_path: Path) -> None:
    m = cc.load_urdf(
        '<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0.2 0.3" '
        'rpy="0.4 0.5 0.6"/><mass value="2"/><inertia ixx="0.01" ixy="0.001" ixz="0.002" '
        'iyy="0.02" iyz="0.003" izz="0.025"/></inertial></link><joint name="j" type="revolute">'
        '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
        '<dynamics damping="0.5" friction="0.25"/></joint><transmission name="m"><joint name="j"/>'
        '<actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>'
        "</transmission></robot>"
    )
    again, _ = out_and_in(m, form, tmp_path)
    (joint,) = (j for j in again.description.joints if j.type == "revolute")
    assert (joint.damping, joint.friction) == (0.5, 0.25)
    assert (joint.lower, joint.upper) == (-1.0, 2.0)
    assert [(i.name, i.joint) for i in again.description.inputs] == [("m", "j")]
    if form != "sdf":
        assert again.description.inputs[0].reduction == 50.0
    mine, theirs = m.model.inertias[1], again.model.inertias[again.model.getJointId("j")]
    assert_close(theirs.matrix(), mine.matrix(), 1e-9)


@pytest.mark.parametrize("form", FORMATS)
def test_a_home_beyond_limits_a_link_called_world_and_an_inertia_of_a_rod(
    form: str, tmp_path: Path
) -> None:
    """As in stock files of walking robots, of arms on a table, and of antennas."""
    m = cc.load_urdf(
        '<robot name="r"><link name="world"/><link name="arm"><inertial><mass value="1"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0"/></inertial></link>'
        '<link name="tip"/><joint name="j" type="revolute"><parent link="world"/>'
        '<child link="arm"/><axis xyz="0 0 1"/>'
        '<limit lower="0.5" upper="1" effort="1" velocity="1"/></joint><joint name="t" '
        'type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/></joint></robot>'
    )
    again, losses = out_and_in(m, form, tmp_path)
    assert_close(again.home, [0.0], 0.0)
    assert_close(again.point(again.home, "tip"), [1.0, 0.0, 0.0], 1e-12)
    assert ("world_link" in again.frame_ids) == (form == "sdf")
    assert any("called 'world_link'" in sentence for sentence in losses) == (form == "sdf")


def test_a_ball_of_the_tree_is_a_ball_in_mujoco(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    m = cc.load_urdf(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="ball">'
        '<parent link="a"/><child link="b"/><origin xyz="1 2 3"/></joint></robot>'
    )
    text, _ = cc.export(m, "mjcf")
    model = mujoco.MjModel.from_xml_string(text)
    assert (model.nq, model.neq) == (4, 0)
    again, _ = out_and_in(m, "mjcf", tmp_path)
    assert cc.mobility(again).mobility == 3
    assert [(c.name, c.kind) for c in again.closures] == [("j_ball", "spherical")]


@pytest.mark.parametrize("name", ["d1", "linear_delta", "rpa3t", "rus6", "eclipse"])
def test_mujoco_closes_where_we_close(name: str) -> None:
    """Gauss-Newton on MuJoCo's rows and Jacobian alone, inputs held, ends in our posture."""
    mujoco = pytest.importorskip("mujoco")
    m = cc.load(name)
    text, _ = cc.export(m, "mjcf")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    start = at(model, model.qpos0)
    assert opening(start) < 1e-12
    assert worst_pose(m, start, m.home) < 1e-12
    s = cc.direct(m, m.input_values(m.home) + 0.02).raise_if_failed()
    wanted = qpos_of(m, model, s.q)
    driven = [model.joint(i.joint).id for i in m.description.inputs]
    qpos = np.array(model.qpos0)
    qpos[model.jnt_qposadr[driven]] = wanted[model.jnt_qposadr[driven]]
    free = np.setdiff1d(np.arange(model.nv), model.jnt_dofadr[driven])
    for _ in range(12):
        data = at(model, qpos)
        rows = np.array(data.efc_pos[: data.ne])
        jacobian = np.array(data.efc_J).reshape(-1, model.nv)[: data.ne][:, free]
        step = np.zeros(model.nv)
        step[free] = -np.linalg.lstsq(jacobian, rows, rcond=1e-9)[0]
        mujoco.mj_integratePos(model, qpos, step, 1.0)
    end = at(model, qpos)
    assert opening(end) < 1e-12
    assert worst_pose(m, end, s.q) < 1e-9


@pytest.mark.parametrize("form", ["urdf", "urdf+"])
def test_stock_parsers_load_the_tree(form: str, tmp_path: Path) -> None:
    """Pinocchio's own parser has the bodies where we have them; yourdfpy finds nothing wrong."""
    yourdfpy = pytest.importorskip("yourdfpy")
    for name in ("linear_delta", "rpa3t"):
        m = cc.load(name)
        text, _ = cc.export(m, form)
        stock = pin.buildModelFromXML(text)
        q = pin.neutral(stock)
        for joint, values in home_values(m).items():
            start = stock.joints[stock.getJointId(joint)].idx_q
            q[start : start + len(values)] = values
        data = stock.createData()
        pin.framesForwardKinematics(stock, data, q)
        for frame in m.frame_ids:
            place = data.oMf[stock.getFrameId(frame, pin.FrameType.BODY)]
            assert_close(place.homogeneous, m.pose(m.home, frame).homogeneous, 1e-12)
        file = tmp_path / "robot.urdf"
        file.write_text(text)
        robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_scene_graph=False)
        assert robot.validate()
        assert len(robot.joint_map) == len(m.description.joints)


def test_unknown_formats_and_open_homes_are_refused() -> None:
    with pytest.raises(DescriptionError, match="known: urdf, mjcf, sdf, "):
        cc.export(cc.load("d1"), "usd")


def test_a_urdf_that_is_there_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text("mine")
    with pytest.raises(DescriptionError, match="is there already"):
        cc.export(cc.load("linear_delta"), "robot.yaml", tmp_path / "robot.yaml")
    assert (tmp_path / "robot.urdf").read_text() == "mine"
    assert not (tmp_path / "robot.yaml").exists()


def test_postures_that_do_not_close_are_a_loss() -> None:
    m = cc.load_urdf(
        cc.export(cc.load("linear_delta"), "urdf")[0].replace(
            "</robot>",
            '<group_state name="torn"><joint name="leg1_B" value="0.1"/>'
            '<joint name="leg1_D" value="0.9"/><joint name="leg1_E" value="-0.4"/>'
            '<joint name="leg1_G" value="0.2"/></group_state></robot>',
        )
    )
    assert "the posture 'torn' does not close and is not written" in cc.export(m, "urdf")[1]
