# SPDX-License-Identifier: Apache-2.0
"""Messages to NumPy and back: round trips, and the refusal of what can't be used."""

import copy
import math

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Pose, PoseArray, PoseStamped, Quaternion, Vector3
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import Marker

from msg_adapters import MessageError, geometry, markers, status, trajectory
from msg_adapters.pose_array import cdr_from_orientations, orientations_from_cdr

STAMP = 1_700_000_000_123_456_789
# Asymmetric, so that a swap of components or of frames that undoes itself elsewhere is seen.
ODD = np.array([0.1, -0.2, 0.3, 0.9])
ODD = ODD / np.linalg.norm(ODD)
RATE = np.array([0.01, -0.02, 0.03])


def test_pose_round_trip_keeps_order_and_stamp():
    message = geometry.pose_from_attitude(ODD, STAMP, "inertial")
    assert (message.pose.orientation.x, message.pose.orientation.w) == (ODD[0], ODD[3])
    back = geometry.attitude_from_pose(message, "inertial")
    assert np.allclose(back.quaternion, ODD, atol=1e-15)
    assert back.stamp == STAMP
    assert not back.rate.any()


def test_odometry_and_imu_round_trips_keep_the_body_rate():
    message = geometry.odometry_from_attitude(ODD, RATE, STAMP, ("inertial", "base_link"))
    back = geometry.attitude_from_odometry(message, "inertial", "base_link")
    assert np.allclose(back.quaternion, ODD, atol=1e-15)
    assert np.array_equal(back.rate, RATE)
    imu = geometry.attitude_from_imu(
        geometry.imu_from_attitude(ODD, RATE, STAMP, "base_link"), "base_link"
    )
    assert np.allclose(imu.quaternion, ODD, atol=1e-15)
    assert np.array_equal(imu.rate, RATE)


@pytest.mark.parametrize("length", [5e-324, 1e-300, 1.0, 1e300])
def test_directions_of_any_length_are_unit(length):
    message = geometry.vector_from_direction(np.array([length, 0.0, 0.0]), STAMP, "inertial")
    assert np.allclose(geometry.direction_from_vector(message, "inertial").vector, [1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "values",
    [
        (math.nan, 0.0, 0.0, 1.0),
        (0.0, math.inf, 0.0, 1.0),
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 1.002),
        (0.0, 0.0, 0.0, 0.998),
        (1e200, 1e200, 0.0, 0.0),
        (5e-324, 0.0, 0.0, 0.0),
    ],
)
def test_bad_quaternions_are_refused_with_field_and_value(values):
    x, y, z, w = values
    message = PoseStamped()
    message.header.frame_id = "inertial"
    message.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    before = copy.deepcopy(message)
    with pytest.raises(MessageError) as caught:
        geometry.attitude_from_pose(message, "inertial")
    assert caught.value.field == "pose.orientation"
    assert str(list(values))[1:-1] in caught.value.value
    assert str(before) == str(message)


def test_a_quaternion_within_1e_3_of_unit_is_normalised():
    q = geometry.quaternion_from_message(Quaternion(x=0.0, y=0.0, z=0.0, w=1.0009))
    assert np.array_equal(q, [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("frame", ["", "map", "inertial "])
def test_wrong_and_empty_frames_are_refused(frame):
    message = geometry.pose_from_attitude(ODD, STAMP, frame)
    with pytest.raises(MessageError, match=r"header.frame_id"):
        geometry.attitude_from_pose(message, "inertial")
    odometry = geometry.odometry_from_attitude(ODD, RATE, STAMP, ("inertial", frame))
    with pytest.raises(MessageError, match=r"child_frame_id"):
        geometry.attitude_from_odometry(odometry, "inertial", "base_link")


def test_an_imu_without_orientation_is_refused():
    message = geometry.imu_from_attitude(ODD, RATE, STAMP, "base_link")
    message.orientation_covariance[0] = -1.0
    with pytest.raises(MessageError, match=r"orientation_covariance\[0\]"):
        geometry.attitude_from_imu(message, "base_link")


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (math.nan, 1.0, 0.0), (math.inf, 0.0, 0.0)])
def test_bad_directions_are_refused(vector):
    x, y, z = vector
    with pytest.raises(MessageError, match="vector"):
        geometry.direction_from_message(Vector3(x=x, y=y, z=z))


@pytest.mark.parametrize("rate", [(math.nan, 0.0, 0.0), (0.0, 1e4, 0.0)])
def test_rates_that_nothing_turns_at_are_refused(rate):
    x, y, z = rate
    with pytest.raises(MessageError, match=r"twist"):
        geometry.rate_from_message(Vector3(x=x, y=y, z=z), "twist")


def test_a_negative_stamp_is_refused():
    message = geometry.pose_from_attitude(ODD, STAMP, "inertial")
    message.header.stamp.sec = -1
    with pytest.raises(MessageError, match=r"header.stamp"):
        geometry.attitude_from_pose(message, "inertial")


@pytest.mark.parametrize("count", [0, 1, 7])
@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "inertial", "base_link"])
def test_pose_arrays_as_bytes_are_what_ros_makes_of_the_message(count, frame):
    rng = np.random.default_rng(count)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    message = PoseArray(
        header=geometry.header(STAMP, frame),
        poses=[Pose(orientation=geometry.quaternion_to_message(q)) for q in quaternions],
    )
    data = cdr_from_orientations(quaternions, STAMP, frame)
    theirs = serialize_message(message)
    assert deserialize_message(data, PoseArray) == message
    assert len(data) == len(theirs)
    back = orientations_from_cdr(theirs, frame, 10)
    assert np.allclose(back.quaternions, quaternions, atol=1e-15)
    assert back.stamp == STAMP


def test_bad_pose_arrays_are_refused_whole():
    good = cdr_from_orientations(np.array([ODD, ODD]), STAMP, "inertial")
    for data in (b"", good[:3], good[:20], good[:-8], good[:-1]):
        with pytest.raises(MessageError):
            orientations_from_cdr(data, "inertial", 10)
    with pytest.raises(MessageError, match="at most 1"):
        orientations_from_cdr(good, "inertial", 1)
    bad = cdr_from_orientations(np.array([ODD, 2 * ODD]), STAMP, "inertial")
    with pytest.raises(MessageError, match=r"poses\[1\]"):
        orientations_from_cdr(bad, "inertial", 10)
    with pytest.raises(MessageError, match="frame_id"):
        orientations_from_cdr(good, "other", 10)


def test_trajectory_round_trip():
    rng = np.random.default_rng(3)
    quaternions = np.array([ODD, -ODD])
    samples = trajectory.Samples(
        np.array([0.0, 0.5]), quaternions, rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    )
    message = trajectory.reference_from_samples(samples, STAMP, ("inertial", "base_link"))
    assert message.joint_names == ["base_link"]
    back, stamp = trajectory.samples_from_reference(message)
    assert stamp == STAMP
    for ours, theirs in zip(samples, back, strict=True):
        assert np.allclose(ours, theirs, atol=1e-15)


@pytest.mark.parametrize("count", [0, 1, 7])
@pytest.mark.parametrize("frames", [("", "b"), ("ab", "body"), ("abc", "base_link"), ("a", "")])
def test_references_as_bytes_are_what_ros_makes_of_the_message(count, frames):
    rng = np.random.default_rng(count)
    quaternions = rng.normal(size=(count, 4))
    times = np.sort(rng.uniform(0.0, 1e4, count))
    samples = trajectory.Samples(times, quaternions, *rng.normal(size=(2, count, 3)))
    message = trajectory.reference_from_samples(samples, STAMP, frames)
    data = trajectory.cdr_from_samples(samples, STAMP, frames)
    assert deserialize_message(data, MultiDOFJointTrajectory) == message
    assert len(data) == len(serialize_message(message))


def test_a_setpoint_message_is_filled_anew():
    pool = trajectory.SetpointMessage("inertial", "base_link")
    pool.filled(1, np.array([0.0, 0.0, 0.0, 1.0]), RATE, RATE)
    message = pool.filled(STAMP, ODD, 2 * RATE, 3 * RATE)
    back, stamp = trajectory.samples_from_reference(message)
    assert stamp == STAMP
    assert np.allclose(back.quaternions[0], ODD, atol=1e-15)
    assert np.array_equal(back.rates[0], 2 * RATE)
    assert np.array_equal(back.accelerations[0], 3 * RATE)


def _scene(zones):
    caps = tuple(markers.Cap(name, False, np.array([0.0, 0.0, 1.0]), 0.4) for name in zones)
    return markers.Scene(
        {"boresight": np.eye(3)}, caps, ("sun: 3 deg", np.eye(3)[0]), np.eye(3)[None], np.eye(3)[0]
    )


def test_markers_keep_their_ids_and_old_ones_are_deleted():
    first, keys = markers.markers_from_scene(_scene(["sun", "moon"]), STAMP, "inertial")
    second, again = markers.markers_from_scene(_scene(["sun"]), STAMP, "inertial", keys)
    assert again < keys
    deleted = {(m.ns, m.id) for m in second.markers if m.action == Marker.DELETE}
    assert deleted == keys - again == {("zones/moon", 0), ("zones/moon", 1)}
    assert all(m.header.frame_id == "inertial" for m in first.markers + second.markers)


def test_a_cap_lies_on_the_sphere_within_its_half_angle():
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    points = markers.cap_triangles(axis, 0.4)
    angles = np.arccos(points @ axis)
    assert np.allclose(np.linalg.norm(points, axis=1), 1.0)
    assert angles.max() == pytest.approx(0.4, abs=1e-9)
    corners = points.reshape(-1, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.sum(normals * corners.mean(axis=1), axis=1) > -1e-12)


def test_status_round_trip_reads_as_people_do():
    values = {"cost": 1.23456789, "certified": True, "count": 3}
    message = status.status_from_report(status.WARN, "node: plan", "well", values, "base_link")
    level, text, back = status.report_from_status(message)
    assert (level, text) == (status.WARN, "well")
    assert back == {"cost": "1.23457", "certified": "yes", "count": "3"}
