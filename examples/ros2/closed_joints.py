"""ROS 2 node: takes the driven joints of a closed-chain robot, publishes all of its joints.

    python closed_joints.py linear_delta
    ros2 run robot_state_publisher robot_state_publisher \\
        --ros-args -p robot_description:="$(closedchain urdf linear_delta)"

Bodies on floating joints of the description go to /tf, since joint states cannot say them.
"""

import sys

import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from tf2_ros import TransformBroadcaster

import closedchain as cc


class ClosedJoints(Node):
    """Subscribes to ``driven_joints``, publishes ``joint_states`` and ``/tf``."""

    def __init__(self, robot: str) -> None:
        super().__init__("closed_joints")
        self.robot = cc.load(robot) if robot in cc.robots() else cc.load_file(robot)
        self.joints = {joint.name: joint for joint in self.robot.description.joints}
        self.q = self.robot.closed_home()
        self.states = self.create_publisher(JointState, "joint_states", 10)
        self.transforms = TransformBroadcaster(self)
        self.create_subscription(JointState, "driven_joints", self.move, 10)

    def move(self, driven: JointState) -> None:
        """Close the loops for the driven joints; at a singularity the robot stays where it is."""
        try:
            values = dict(zip(driven.name, driven.position, strict=True))
            found = cc.joint_positions(self.robot, values, self.q)
        except (cc.ClosedChainError, ValueError) as error:
            self.get_logger().error(str(error))
            return
        if not found.arrived:
            self.get_logger().warning(found.message)
        self.q, now = found.q, self.get_clock().now().to_msg()
        state = JointState(name=list(found.names), position=found.values.tolist())
        state.header.stamp = now
        self.states.publish(state)
        for name, pose in found.floating.items():
            body = TransformStamped(child_frame_id=self.joints[name].child)
            body.header.stamp, body.header.frame_id = now, self.joints[name].parent
            place, turn = body.transform.translation, body.transform.rotation
            place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = pose.tolist()
            self.transforms.sendTransform(body)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(ClosedJoints(sys.argv[1]))
