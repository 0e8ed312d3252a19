"""The ROS 2 node of examples/ros2, with stand-ins for the few names of ROS that it uses."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close

import closedchain as cc

NODE = Path(__file__).resolve().parents[1] / "examples" / "ros2" / "closed_joints.py"


class Message(SimpleNamespace):
    """A ROS message: its fields by keyword, and those that messages here have besides."""

    def __init__(self, **fields: Any) -> None:
        turn = SimpleNamespace(translation=SimpleNamespace(), rotation=SimpleNamespace())
        super().__init__(header=SimpleNamespace(), transform=turn, **fields)


class Node:
    """What the node uses of ``rclpy.node.Node``; published messages and log lines are kept."""

    def __init__(self, name: str) -> None:
        self.sent: list[Any] = []
        self.said: list[str] = []
        self.subscribed: dict[str, Any] = {}

    def create_publisher(self, kind: type, topic: str, depth: int) -> Any:
        assert topic == "joint_states"
        return SimpleNamespace(publish=self.sent.append)

    def create_subscription(self, kind: type, topic: str, callback: Any, depth: int) -> None:
        self.subscribed[topic] = callback

    def get_logger(self) -> Any:
        return SimpleNamespace(error=self.said.append, warning=self.said.append)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))


class Broadcaster:
    def __init__(self, node: Node) -> None:
        self.sendTransform = node.sent.append


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    fakes = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "geometry_msgs": {},
        "geometry_msgs.msg": {"TransformStamped": Message},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"JointState": Message},
        "tf2_ros": {"TransformBroadcaster": Broadcaster},
    }
    for name, contents in fakes.items():
        fake = ModuleType(name)
        vars(fake).update(contents)
        monkeypatch.setitem(sys.modules, name, fake)
    spec = importlib.util.spec_from_file_location("closed_joints", NODE)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.parametrize("robot", ["linear_delta", "d1"])
def test_states_place_the_bodies_of_the_robot_description(module: ModuleType, robot: str) -> None:
    """Read by urdfdom, as robot_state_publisher reads it, the tree stands where the robot does."""
    m = cc.load(robot)
    node = module.ClosedJoints(robot)
    moved = m.input_values(m.home)[0] + 0.01
    node.subscribed["driven_joints"](Message(name=[m.inputs[0]], position=[moved]))
    state, *bodies = node.sent
    assert state.header.stamp == "now"
    model = pin.buildModelFromXML(m.description.text)
    q = pin.neutral(model)
    for name, value in zip(state.name, state.position, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = value
    for body in bodies:
        (joint,) = (j for j in m.description.joints if j.child == body.child_frame_id)
        assert (joint.type, joint.parent) == ("floating", body.header.frame_id)
        where, turn = body.transform.translation, body.transform.rotation
        first = model.joints[model.getJointId(joint.name)].idx_q
        q[first : first + 7] = where.x, where.y, where.z, turn.x, turn.y, turn.z, turn.w
    assert len(state.name) + len(bodies) == model.njoints - 1
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    expected = cc.direct(m, [moved, *m.input_values(m.home)[1:]]).raise_if_failed()
    tip = m.task.tip
    assert_close(data.oMf[model.getFrameId(tip)].translation, m.point(expected.q, tip), 1e-9)
    assert np.abs(cc.residual(m, node.q)).max() < 1e-12


def test_it_stays_at_a_singularity_and_says_so(module: ModuleType) -> None:
    node = module.ClosedJoints("linear_delta")
    node.move(Message(name=["q1"], position=[-5.0]))
    node.move(Message(name=["nobody"], position=[1.0]))
    node.move(Message(name=["q1"], position=[]))
    assert "direct singularity" in node.said[0]
    assert "unknown driven joint 'nobody'" in node.said[1]
    assert len(node.said) == 3
    assert len(node.sent) == 1
    node.move(Message(name=["q1"], position=[-0.15]))
    assert node.sent[-1].position[0] == -0.15
