# SPDX-License-Identifier: Apache-2.0
"""The node in one process: every input, every output, the services, bad messages."""

import copy
import math

import numpy as np
import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose, PoseArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from msg_adapters import geometry
from msg_adapters.trajectory import SetpointMessage
from riem_planner import Trajectory
from riem_planner.geometry import so3

FRAME, BODY = "inertial", "base_link"
SUN = {"sun__direction": [0.0, 0.0, 1.0], "sun__half_angle": 0.3}
Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))
X_TURN = so3.quaternion_exp(np.array([1.0, 0.2, 0.0]))
REST = np.zeros(3)


def _stamp(bench, offset=0.0):
    return bench.node.now_ns() + round(offset * 1e9)


def _arrived(bench, quaternion):
    def reached():
        found = bench.setpoints()[-1:]
        return bool(found) and so3.quaternion_distance(found[0].quaternion, quaternion) < 1e-9

    return reached


def test_a_goal_gives_a_trajectory_a_reference_markers_a_status_and_a_stream(ros):
    bench = ros(["sun"], **SUN)
    assert not bench.heard["setpoint"]
    bench.goal(Z_TURN)
    bench.wait(lambda: all(bench.heard[name] for name in ("trajectory", "reference", "markers")))
    bench.wait(_arrived(bench, Z_TURN), 10.0)
    trajectory, reference = bench.heard["trajectory"][-1], bench.heard["reference"][-1]
    assert len(trajectory.poses) == len(reference.points) == 121
    assert trajectory.header == reference.header
    assert trajectory.header.frame_id == FRAME
    assert reference.joint_names == [BODY]
    for pose, point in zip(trajectory.poses, reference.points, strict=True):
        assert pose.orientation == point.transforms[0].rotation
    flying = bench.heard["status"][bench.codes().index("FLYING")]
    assert flying.name == "/riem_planner: planner"
    values = {item.key: item.value for item in flying.values}
    assert values["certified"] == "yes"
    assert float(values["clearance_deg.sun"]) > 0.0
    assert float(values["solve_time_ms"]) > 0.0
    namespaces = {marker.ns for marker in bench.heard["markers"][-1].markers}
    assert {"path/boresight", "zones/sun", "worst_clearance", "body_axes"} <= namespaces
    bench.check_continuity()


def test_the_stream_is_what_the_reference_says_and_both_setpoints_agree(ros):
    bench = ros()
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 30)
    message = bench.heard["reference"][-1]
    from msg_adapters.trajectory import samples_from_reference

    samples, start_ns = samples_from_reference(message)
    planned = Trajectory(*samples)
    for setpoint in bench.setpoints()[:30]:
        q, v, a = planned.evaluate_quaternion((setpoint.stamp_ns - start_ns) * 1e-9)
        assert so3.quaternion_distance(q, setpoint.quaternion) < 1e-6
        assert np.abs(v - setpoint.rate).max() < 1e-5
        assert np.abs(a - setpoint.acceleration).max() < 1e-3
    alone = {m.header.stamp.nanosec: m.quaternion for m in bench.heard["attitude_setpoint"]}
    for message in bench.heard["setpoint"][:30]:
        stamp = message.header.stamp.nanosec
        assert alone[stamp] == message.points[0].transforms[0].rotation


def test_goal_state_state_and_imu_are_taken(ros):
    bench = ros()
    bench.send("imu", geometry.imu_from_attitude(X_TURN, REST, _stamp(bench), BODY))
    bench.wait(lambda: bench.node.mission.measured is not None)
    bench.send("goal_state", geometry.odometry_from_attitude(Z_TURN, REST, 0, (FRAME, BODY)))
    bench.wait(lambda: len(bench.heard["setpoint"]) > 2)
    assert so3.quaternion_distance(bench.setpoints()[0].quaternion, X_TURN) < 1e-3
    off = so3.quaternion_multiply(X_TURN, so3.quaternion_exp(np.array([0.1, 0.0, 0.0])))
    bench.send("state", geometry.odometry_from_attitude(off, REST, 0, (FRAME, BODY)))

    def warned():
        entries = [s for m in bench.heard["diagnostics"] for s in m.status]
        return any("tracking_bound" in s.message for s in entries if s.name.endswith("tracking"))

    bench.wait(warned, 3.0)


def test_obstacles_are_replaced_as_a_set_and_cleared_by_an_empty_one(ros):
    bench = ros(obstacle_radius=0.2)
    bench.goal(Z_TURN)
    bench.wait(lambda: "FLYING" in bench.codes())
    on_the_way = so3.quaternion_exp(np.array([0.0, 0.0, 0.9]))
    message = PoseArray(header=geometry.header(0, FRAME))
    message.poses = [Pose(orientation=geometry.quaternion_to_message(on_the_way))]
    bench.send("obstacles", message)
    bench.wait(lambda: "STOP" in bench.codes())
    bench.wait(lambda: bench.codes()[-1] == "FLYING")
    bench.wait(_arrived(bench, Z_TURN), 12.0)
    closest = min(so3.quaternion_distance(s.quaternion, on_the_way) for s in bench.setpoints())
    assert closest > 0.2
    bench.check_continuity()
    bench.send("obstacles", PoseArray(header=geometry.header(0, FRAME)))
    bench.wait(lambda: not bench.node.mission.world.obstacles(0))


def test_a_zone_message_moves_the_zone(ros):
    bench = ros(["sun"], sun__half_angle=0.3)
    bench.goal(Z_TURN)
    bench.wait(lambda: bench.codes()[-1:] == ["WAITING"])
    bench.zone("sun", [0.0, 0.0, 5.0])
    bench.wait(lambda: bench.codes()[-1:] == ["FLYING"])
    bench.zone("sun", so3.exp(np.array([0.0, 0.05, 0.8])) @ np.array([1.0, 0.0, 0.0]))
    bench.wait(lambda: bench.codes().count("FLYING") == 2)
    bench.wait(_arrived(bench, Z_TURN), 12.0)
    bench.check_continuity()


def test_a_body_and_obstacles_that_turn_are_heard(ros):
    bodies = {"a__body": "sun", "b__body": "sun", "a__half_angle": 0.2, "b__half_angle": 0.1}
    bench = ros(["a", "b"], **bodies)
    topics = {subscription.topic_name for subscription in bench.node.subscriptions}
    assert "/riem_planner/bodies/sun" in topics
    assert not any(name.startswith("/riem_planner/zones/") for name in topics)
    sun = geometry.vector_from_direction(np.array([0.0, 3.0, 4.0]), 0, FRAME)
    body = bench.client.create_publisher(type(sun), "/riem_planner/bodies/sun", 1)
    bench.wait(lambda: body.get_subscription_count() > 0)
    body.publish(sun)
    world = bench.node.mission.world
    bench.wait(lambda: not world.missing)
    assert all(zone.direction == pytest.approx([0.0, 0.6, 0.8]) for zone in world.obstacles(0))
    # Another planner's setpoint is an obstacle that turns.
    message = SetpointMessage(FRAME, "other").filled(
        bench.node.now_ns(), Z_TURN, np.array([0.0, 0.01, 0.0]), REST
    )
    states = bench.client.create_publisher(type(message), "/riem_planner/obstacle_states", 1)
    bench.wait(lambda: states.get_subscription_count() > 0)
    states.publish(message)
    bench.wait(lambda: len(world.obstacles(bench.node.now_ns())) == 3)
    (obstacle,) = world.obstacles(bench.node.now_ns())[2:]
    assert obstacle.name == "obstacle_states/other"
    assert np.linalg.norm(obstacle.rate) == pytest.approx(0.01)
    message.joint_names.append("one too many")
    states.publish(message)
    bench.wait(lambda: "~/obstacle_states" in bench.node.outputs.rejections.last)


def test_qos_of_outputs_can_be_set_for_a_watchdog(ros):
    prefix = "qos_overrides./riem_planner/setpoint.publisher."
    bench = ros(**{f"{prefix}deadline".replace(".", "_DOT_"): 100_000_000})
    (setpoint,) = (
        p for p in bench.node.publishers if p.topic_name == "/riem_planner/setpoint"
    )  # fmt: skip
    assert setpoint.qos_profile.deadline.nanoseconds == 100_000_000
    for policy in ("lifespan", "liveliness", "liveliness_lease_duration"):
        assert bench.node.has_parameter(prefix + policy)


def test_late_joiners_get_the_plan(ros):
    bench = ros()
    bench.goal(Z_TURN)
    bench.wait(lambda: "FLYING" in bench.codes())
    late = []
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    bench.client.create_subscription(PoseArray, "/riem_planner/trajectory", late.append, qos)
    bench.wait(lambda: bool(late))


def test_a_new_goal_in_mid_slew_is_spliced_without_a_jump(ros):
    bench = ros()
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 60)
    bench.goal(-X_TURN)
    bench.wait(_arrived(bench, X_TURN), 10.0)
    bench.check_continuity()


def test_cancel_stops_and_replan_needs_a_goal(ros):
    bench = ros()
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 60)
    assert bench.trigger("replan").success
    response = bench.trigger("cancel")
    assert response.success
    assert "certified stop" in response.message
    bench.wait(lambda: not bench.setpoints()[-1].rate.any(), 8.0)
    assert not bench.trigger("replan").success
    bench.check_continuity()


def test_approve_then_fly(ros):
    bench = ros(auto_execute=False)
    bench.goal(Z_TURN)
    bench.wait(lambda: bool(bench.heard["trajectory"]) and "SHOWN" in bench.codes())
    assert not bench.heard["setpoint"]
    assert bench.trigger("execute").success
    bench.wait(_arrived(bench, Z_TURN), 8.0)


def _bad(name, base, **changes):
    message = copy.deepcopy(base)
    for path, value in changes.items():
        target = message
        *parents, field = path.split("__")
        for parent in parents:
            target = getattr(target, parent)
        setattr(target, field, value)
    return name, message


def _bad_messages(now_ns):
    goal = geometry.pose_from_attitude(X_TURN, 0, FRAME)
    odometry = geometry.odometry_from_attitude(X_TURN, REST, 0, (FRAME, BODY))
    imu = geometry.imu_from_attitude(X_TURN, REST, 0, BODY)
    zone = geometry.vector_from_direction(np.array([0.0, 0.0, 1.0]), 0, FRAME)
    past = geometry.time_from_nanoseconds(now_ns - 10**10)
    future = geometry.time_from_nanoseconds(now_ns + 10**10)
    return [
        (*_bad("goal", goal, pose__orientation__x=math.nan), "pose.orientation"),
        (*_bad("goal", goal, header__frame_id=""), "header.frame_id"),
        (*_bad("goal", goal, header__stamp=past), "header.stamp"),
        (*_bad("goal_state", odometry, child_frame_id="camera"), "child_frame_id"),
        (*_bad("goal_state", odometry, header__stamp=future), "header.stamp"),
        (*_bad("state", odometry, twist__twist__angular__y=math.inf), "twist.twist.angular"),
        (*_bad("imu", imu, orientation__w=5.0), "orientation"),
        (*_bad("zones/sun", zone, vector__z=0.0), "vector"),
        (*_bad("zones/sun", zone, vector__x=math.nan), "vector"),
    ]


def test_bad_messages_are_rejected_whole_named_and_change_nothing(ros):
    bench = ros(["sun"], **SUN)
    bench.goal(Z_TURN)
    bench.wait(lambda: "FLYING" in bench.codes())
    flown = bench.node.mission.timeline.last
    rejections = bench.node.outputs.rejections
    bad = _bad_messages(bench.node.now_ns())
    for sent, (name, message, field) in enumerate(bad, start=1):
        bench.send(name, message)
        bench.wait(lambda n=sent: sum(rejections.counts.values()) == n)
        assert field in rejections.last[f"~/{name}"]
    bench.wait(lambda: bench.codes().count("REFUSED") == len(bad))
    assert bench.node.mission.timeline.last is flown
    assert bench.node.mission.measured is None
    refusals = [m for m in bench.heard["status"] if "rejected:" in m.message]
    assert bench.codes().count("REFUSED") == len(refusals) == len(bad)
    assert all(m.level == DiagnosticStatus.ERROR for m in refusals)


def test_a_zero_stamp_means_now(ros):
    bench = ros(["sun"], **SUN)
    bench.zone("sun", [0.0, 1.0, 0.0], stamp_ns=0)
    bench.wait(lambda: bench.node.mission.world.age("zones/sun", bench.node.now_ns()) is not None)
    assert 0.0 <= bench.node.mission.world.age("zones/sun", bench.node.now_ns()) < 5.0


def _change(bench, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return bench.call(ChangeState, "change_state", request, 30.0).success


def test_invalid_transitions_are_refused_and_the_node_lives(ros):
    bench = ros(active=False, autostart=False)
    assert not _change(bench, Transition.TRANSITION_ACTIVATE)
    assert not _change(bench, 77)
    request = ChangeState.Request(transition=Transition(label="nonsense"))
    assert not bench.call(ChangeState, "change_state", request).success
    assert bench.call(GetState, "get_state").current_state.label == "unconfigured"
    assert _change(bench, Transition.TRANSITION_CONFIGURE)
    assert not _change(bench, Transition.TRANSITION_CONFIGURE)
    assert bench.state() == "inactive"


def test_deactivate_ends_the_stream_after_a_certified_stop(ros):
    bench = ros()
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 60)
    assert _change(bench, Transition.TRANSITION_DEACTIVATE)
    bench.wait(lambda: not bench.setpoints()[-1].rate.any())
    count = len(bench.heard["setpoint"])
    bench.check_continuity()
    assert _change(bench, Transition.TRANSITION_ACTIVATE)
    assert len(bench.heard["setpoint"]) <= count + 1
    # From the measured state again.
    bench.send("state", geometry.odometry_from_attitude(X_TURN, REST, 0, (FRAME, BODY)))
    bench.wait(lambda: bench.node.mission.measured is not None)
    bench.heard["setpoint"].clear()
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 2)
    assert so3.quaternion_distance(bench.setpoints()[0].quaternion, X_TURN) < 1e-2
    assert _change(bench, Transition.TRANSITION_DEACTIVATE)
    assert _change(bench, Transition.TRANSITION_CLEANUP)
    assert _change(bench, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert bench.state() == "finalized"


def _parameter(name, **value):
    kinds = {
        "double_value": ParameterType.PARAMETER_DOUBLE,
        "bool_value": ParameterType.PARAMETER_BOOL,
        "string_value": ParameterType.PARAMETER_STRING,
    }
    ((key, content),) = value.items()
    return ParameterMessage(name=name, value=ParameterValue(type=kinds[key], **{key: content}))


def _set(bench, *parameters, atomically=False):
    if atomically:
        request = SetParametersAtomically.Request(parameters=list(parameters))
        return [bench.call(SetParametersAtomically, "set_parameters_atomically", request).result]
    request = SetParameters.Request(parameters=list(parameters))
    return bench.call(SetParameters, "set_parameters", request).results


def test_parameters_are_described_validated_and_applied_together(ros):
    bench = ros(["sun"], **SUN)
    request = DescribeParameters.Request(names=["duration", "zones.sun.half_angle"])
    for described in bench.call(DescribeParameters, "describe_parameters", request).descriptors:
        assert described.description
        assert described.floating_point_range
    (result,) = _set(bench, _parameter("duration", double_value=-1.0))
    assert not result.successful
    (result,) = _set(bench, _parameter("space", string_value="s2"))
    assert "unconfigured" in result.reason
    good, bad = (
        _parameter("setpoint_rate", double_value=20.0),
        _parameter("planning_budget", double_value=1e9),
    )
    (result,) = _set(bench, good, bad, atomically=True)
    assert not result.successful
    assert bench.node.settings.setpoint_rate == 50.0
    (result,) = _set(bench, good, atomically=True)
    assert result.successful
    assert bench.node.mission.settings.setpoint_rate == 20.0
    bench.goal(Z_TURN)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 10)
    stamps = np.diff([s.stamp_ns for s in bench.setpoints()]) * 1e-9
    assert np.median(stamps) == pytest.approx(0.05, abs=0.01)


def test_lists_are_unset_by_an_empty_one_or_by_deleting_them(ros):
    bench = ros()
    unset = bench.node.get_parameter("limits.rate")
    assert list(unset.value) == []
    for empty in (Parameter.Type.BOOL_ARRAY, Parameter.Type.NOT_SET):  # `[]` in YAML; deletion
        (given,) = bench.node.set_parameters([Parameter("limits.rate", value=[0.1, 0.2, 0.3])])
        assert given.successful
        assert bench.node.settings.limits is not None
        value = [] if empty is Parameter.Type.BOOL_ARRAY else None
        (cleared,) = bench.node.set_parameters([Parameter("limits.rate", empty, value)])
        assert cleared.successful
        assert bench.node.settings.limits is None
        assert bench.node.get_parameter("limits.rate").type_ is Parameter.Type.DOUBLE_ARRAY


def _qos(reliability, durability):
    return QoSProfile(depth=3, reliability=reliability, durability=durability)


RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
LATCHED, VOLATILE = DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE
SENDERS = {
    "early": _qos(RELIABLE, LATCHED),
    "latched": _qos(RELIABLE, LATCHED),
    "reliable": _qos(RELIABLE, VOLATILE),
    "weak": _qos(BEST_EFFORT, VOLATILE),
    "weak_latched": _qos(BEST_EFFORT, LATCHED),
}


def test_every_sender_is_heard_and_each_message_once(ros):
    up = geometry.vector_from_direction(np.array([0.0, 0.0, 1.0]), 0, FRAME)

    def publish(bench, name, topic, message, kind):
        publisher = bench.client.create_publisher(kind, f"/riem_planner/{topic}", SENDERS[name])
        if name != "early":
            bench.wait(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(message)

    def tell_early(bench):
        publish(bench, "early", "zones/early", up, type(up))

    # The goal is flown once all zones are known, so once every sender has been heard.
    bench = ros(list(SENDERS), before=tell_early)
    pose = geometry.pose_from_attitude(X_TURN, 0, FRAME)
    publish(bench, "weak", "goal", pose, type(pose))
    for name in list(SENDERS)[1:]:
        publish(bench, name, f"zones/{name}", up, type(up))
    bench.wait(lambda: "FLYING" in bench.codes())
    version = bench.node.mission.world.version
    assert version == len(SENDERS)  # and no copy counted as another
    wrong = geometry.pose_from_attitude(X_TURN, 0, "moon")
    publish(bench, "latched", "goal", wrong, type(wrong))  # comes three times
    bench.wait(lambda: "REFUSED" in bench.codes())
    bench.call(GetState, "get_state")
    bench.wait(lambda: "ARRIVED" in bench.codes(), 15.0)
    assert bench.codes().count("REFUSED") == 1
    assert bench.codes().count("FLYING") == 1


class _Log:
    def __init__(self, warnings):
        self.warnings = warnings

    def warning(self, text, **_):
        self.warnings.append(text)

    info = error = debug = warn = warning


def test_what_happens_is_logged_and_drawn_while_the_clock_stands_still(ros):
    bench = ros(use_sim_time=True)
    clock = bench.client.create_publisher(Clock, "/clock", 10)
    bench.wait(lambda: clock.get_subscription_count() > 0)
    clock.publish(Clock(clock=geometry.time_from_nanoseconds(100 * 10**9)))
    lines = []
    bench.node.get_logger = lambda: _Log(lines)
    bench.goal(Z_TURN)
    bench.wait(lambda: any(line.startswith("FLYING: ") for line in lines))
    bench.wait(lambda: bench.heard["markers"])


def test_simulated_time_paused_and_set_back(ros):
    bench = ros(use_sim_time=True)
    clock = bench.client.create_publisher(Clock, "/clock", 10)
    bench.wait(lambda: clock.get_subscription_count() > 0)

    def run(begin, steps):
        import time

        for k in range(steps):
            clock.publish(Clock(clock=geometry.time_from_nanoseconds(begin + k * 20_000_000)))
            time.sleep(0.004)

    run(100 * 10**9, 5)
    bench.goal(Z_TURN)
    bench.wait(lambda: bench.node.mission.timeline.segments != (), 10.0)
    run(100 * 10**9 + 100_000_000, 60)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 10)
    before = bench.setpoints()[-1]
    run(50 * 10**9, 20)  # the simulation was set back
    bench.wait(lambda: bench.setpoints()[-1].stamp_ns < 60 * 10**9)
    after = next(s for s in bench.setpoints() if s.stamp_ns < 60 * 10**9)
    assert so3.quaternion_distance(before.quaternion, after.quaternion) < 0.05
    run(50 * 10**9 + 400_000_000, 250)
    bench.wait(_arrived(bench, Z_TURN))
