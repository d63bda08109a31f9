# SPDX-License-Identifier: Apache-2.0
"""The monitor's node hears a planner's topics and latches the first violation."""

import math
import os
import time

import pytest

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 101 + 1))


@pytest.mark.requirement("RP-025")
def test_a_spoiled_stream_on_topics_is_told_and_latched(tmp_path, monkeypatch):
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    import rclpy
    from diagnostic_msgs.msg import DiagnosticStatus
    from geometry_msgs.msg import Transform, Twist
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    from riem_planner.monitor_node.monitor_node import MonitorNode

    context = Context()
    rclpy.init(context=context)
    overrides = {
        "zone_names": ["sun"], "zones.sun.half_angle": 0.3, "zones.sun.direction": [0.0, 1.0, 0.0],
        "limits.rate": 0.5,
    }  # fmt: skip
    node = MonitorNode(
        context=context, parameter_overrides=[Parameter(k, value=v) for k, v in overrides.items()]
    )
    client = Node("client", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    executor.add_node(client)
    stream = client.create_publisher(MultiDOFJointTrajectory, "/riem_planner/setpoint", 10)
    verdicts = []

    def wait(condition):
        end = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.02)

    def setpoint(k, angle):
        point = MultiDOFJointTrajectoryPoint(
            transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()]
        )
        point.transforms[0].rotation.z = math.sin(0.5 * angle)
        point.transforms[0].rotation.w = math.cos(0.5 * angle)
        point.velocities[0].angular.z = 0.4
        message = MultiDOFJointTrajectory(points=[point])
        message.header.stamp.sec, message.header.stamp.nanosec = 100, 20_000_000 * k
        stream.publish(message)

    try:
        wait(lambda: stream.get_subscription_count() > 0)
        for k in range(3):
            setpoint(k, 0.008 * k)
        wait(lambda: node.monitor.setpoints == 3)
        assert node.monitor.verdict is None
        for k in range(3, 5):
            setpoint(k, 1.3 + 0.008 * k)  # within 0.3 rad of y, by a leap
        wait(lambda: node.monitor.setpoints == 5)
        assert {v.sentence for v in node.monitor.violations} == {"M3", "M4"}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        client.create_subscription(
            DiagnosticStatus, "/riem_monitor/verdict", verdicts.append, latched
        )
        wait(lambda: verdicts)
        assert verdicts[0].level == DiagnosticStatus.ERROR
        assert verdicts[0].message.startswith("M3: ")
    finally:
        executor.shutdown()
        client.destroy_node()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
