# SPDX-License-Identifier: Apache-2.0
"""What the node hears: every message checked as a whole, the good ones turned into calls."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import MessageError
from msg_adapters.geometry import (
    Attitude,
    attitude_from_imu,
    attitude_from_odometry,
    attitude_from_pose,
    direction_from_vector,
    nanoseconds_from_time,
)
from msg_adapters.pose_array import orientations_from_cdr
from msg_adapters.trajectory import states_from_point
from riem_planner.mission.mission import Mission
from riem_planner.mission.planning import Goal
from riem_planner.mission.settings import Settings
from riem_planner.mission.zone_tracker import TurningBodies

MOST_OBSTACLES = 500
"""Poses in ~/obstacles; a message with more is a mistake, and would be too slow to plan with."""
GOAL_DEPTH = 10
"""Goals that may wait: none is to be lost."""


@dataclass(frozen=True)
class Desk:
    """What messages are given to.

    Parameters
    ----------
    settings, mission
        Give the present ones.
    calls
        Gives the time [ns] to call the mission with, and publishes what came of it.
    reject
        Called with topic, error, and for a goal the stamp that it is known by [ns].
    warn
        Called with a topic and a sentence about a message that is taken all the same.
    """

    settings: Callable[[], Settings]
    mission: Callable[[], Mission]
    calls: Callable[[], AbstractContextManager[int]]
    reject: Callable[[str, MessageError, int | None], None]
    warn: Callable[[str, str], None]


@dataclass(frozen=True)
class Input:
    """One topic that is heard.

    Parameters
    ----------
    topic, kind
        Of its messages.
    use
        Called with each message, the time [ns], and whether what was sent later has come before.
    depth, streams, raw
        As of an `Ear`.
    goal
        Whether it is told on ~/status what becomes of each message.
    """

    topic: str
    kind: type
    use: Callable[[Any, int, bool], None]
    depth: int = 1
    streams: bool = False
    raw: bool = False
    goal: bool = False


def stamp_of(stamp_ns: int, now_ns: int, timeout: float) -> int:
    """The time of a message [ns], however old; zero means now, one in the future is refused."""
    if stamp_ns == 0 or now_ns == 0:
        return stamp_ns or now_ns  # no time has come on /clock to compare with
    ahead = (stamp_ns - now_ns) * 1e-9
    if ahead > timeout:
        raise MessageError(
            "header.stamp", f"{ahead:.3f} s in the future", f"at most {timeout:g} s ahead"
        )
    return stamp_ns


def fresh_stamp(stamp_ns: int, now_ns: int, timeout: float) -> int:
    """The time of a message [ns] that must not be old."""
    stamp_ns = stamp_of(stamp_ns, now_ns, timeout)
    age = (now_ns - stamp_ns) * 1e-9
    if now_ns and age > timeout:
        raise MessageError("header.stamp", f"{age:.3f} s old", f"at most {timeout:g} s")
    return stamp_ns


class Inputs:
    """The inputs of a planner node, and what is done with their messages.

    Parameters
    ----------
    desk
        What messages are given to.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        settings = desk.settings()
        self.topics = (
            Input("~/goal", PoseStamped, self._goal, depth=GOAL_DEPTH, goal=True),
            Input("~/goal_state", Odometry, self._goal_state, depth=GOAL_DEPTH, goal=True),
            Input("~/state", Odometry, self._state, streams=True),
            Input("~/imu", Imu, self._imu, streams=True),
            # As bytes: a large array as Python objects would stop the stream.
            Input("~/obstacles", PoseArray, self._obstacles, raw=True),
            Input("~/obstacle_states", MultiDOFJointTrajectory, self._obstacle_states),
            *(
                Input(f"~/{source}", Vector3Stamped, partial(self._direction, source))
                for source in dict.fromkeys(zone.source for zone in settings.zones)
            ),
        )

    def receive(self, source: Input, message: Any, late: bool) -> None:
        """Check a message, and call what it is for."""
        desk = self._desk
        with desk.calls() as now_ns:
            if late and not source.goal:
                return  # the newest wins
            try:
                source.use(message, now_ns, late)
            except MessageError as error:
                stamp_ns = _stamp_or(message, now_ns) if source.goal else None
                desk.reject(source.topic, error, stamp_ns)

    @property
    def _settings(self) -> Settings:
        return self._desk.settings()

    def _set_goal(self, attitude: Attitude, topic: str, now_ns: int, late: bool) -> None:
        stamp_ns = fresh_stamp(attitude.stamp, now_ns, self._settings.input_timeout)
        goal = Goal(attitude.quaternion, attitude.rate, stamp_ns, topic, stamp_ns, now_ns)
        mission = self._desk.mission()
        if late:
            mission.ledger.pass_over(goal)
        else:
            mission.set_goal(goal, now_ns, stamped=attitude.stamp != 0)

    def _goal(self, message: PoseStamped, now_ns: int, late: bool) -> None:
        attitude = attitude_from_pose(message, self._settings.reference_frame)
        self._set_goal(attitude, "~/goal", now_ns, late)

    def _goal_state(self, message: Odometry, now_ns: int, late: bool) -> None:
        settings = self._settings
        attitude = attitude_from_odometry(message, settings.reference_frame, settings.body_frame)
        self._set_goal(attitude, "~/goal_state", now_ns, late)

    def _see_state(self, attitude: Attitude, now_ns: int) -> None:
        stamp_ns = fresh_stamp(attitude.stamp, now_ns, self._settings.input_timeout)
        mission = self._desk.mission()
        mission.see_state(attitude.quaternion, attitude.rate, stamp_ns, now_ns)

    def _state(self, message: Odometry, now_ns: int, _: bool) -> None:
        settings = self._settings
        attitude = attitude_from_odometry(message, settings.reference_frame, settings.body_frame)
        self._see_state(attitude, now_ns)

    def _imu(self, message: Imu, now_ns: int, _: bool) -> None:
        self._see_state(attitude_from_imu(message, self._settings.body_frame), now_ns)

    def _told_at(self, topic: str, stamp_ns: int, now_ns: int) -> int:
        """The time of data about the world [ns]: of any age, but a great one is told."""
        timeout = self._settings.input_timeout
        stamp_ns = stamp_of(stamp_ns, now_ns, timeout)
        age = (now_ns - stamp_ns) * 1e-9
        if now_ns and age > timeout:
            self._desk.warn(topic, f"data {age:.3f} s old is taken, more than input_timeout")
        return stamp_ns

    def _obstacles(self, data: bytes, now_ns: int, _: bool) -> None:
        settings = self._settings
        found = orientations_from_cdr(data, settings.reference_frame, MOST_OBSTACLES)
        stamp_ns = self._told_at("~/obstacles", found.stamp, now_ns)
        self._desk.mission().see_obstacles(np.asarray(found.quaternions), stamp_ns, now_ns)

    def _obstacle_states(self, message: MultiDOFJointTrajectory, now_ns: int, _: bool) -> None:
        frame = self._settings.reference_frame
        names, states, told_ns = states_from_point(message, frame, MOST_OBSTACLES)
        stamp_ns = self._told_at("~/obstacle_states", told_ns, now_ns)
        bodies = TurningBodies(names, states.quaternions, states.rates, stamp_ns)
        self._desk.mission().see_turning(bodies, now_ns)

    def _direction(self, source: str, message: Vector3Stamped, now_ns: int, _: bool) -> None:
        direction = direction_from_vector(message, self._settings.reference_frame)
        stamp_ns = self._told_at(f"~/{source}", direction.stamp, now_ns)
        self._desk.mission().see_direction(source, direction.vector, stamp_ns, now_ns)


def _stamp_or(message: Any, now_ns: int) -> int:
    """The stamp of a message that is wrong [ns], or now where it has none."""
    try:
        return nanoseconds_from_time(message.header.stamp) or now_ns
    except MessageError:
        return now_ns
