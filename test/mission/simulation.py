# SPDX-License-Identifier: Apache-2.0
"""Drives a mission in simulated time: the node without ROS."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from riem_planner.mission.mission import Mission
from riem_planner.mission.planning import Goal, carry_out
from riem_planner.mission.settings import default_values, settings_from_values

SECOND = 1_000_000_000
START_NS = 1_700_000_000 * SECOND


def settings(zones=(), **values):
    """Settings with some parameters given, `sun__half_angle` for `zones.sun.half_angle`."""
    given = default_values(tuple(zones))
    for name, value in values.items():
        zone, _, key = name.partition("__")
        given[f"zones.{zone}.{key}" if key else name.replace("_DOT_", ".")] = value
    return settings_from_values(given)


class Simulation:
    """A mission, its clock, its stream, and a worker that takes a given time for a plan."""

    def __init__(self, parameters, *, solve_time=0.01, period=0.02):
        self.mission = Mission(parameters)
        self.now_ns = START_NS
        self.period_ns = round(period * SECOND)
        self.solve_time_ns = round(solve_time * SECOND)
        self.setpoints = []
        self.events = []
        self.solves = 0
        self._busy = None
        self.mission.activate(self.now_ns)

    def goal(self, quaternion, rate=(0.0, 0.0, 0.0)):
        """Send a goal."""
        q = np.asarray(quaternion, dtype=float)
        goal = Goal(q / np.linalg.norm(q), np.asarray(rate, dtype=float), self.now_ns)
        return self.mission.set_goal(goal, self.now_ns, stamped=False)

    def zone(self, name, direction):
        """Send the direction of a zone."""
        d = np.asarray(direction, dtype=float)
        self.mission.see_direction(f"zones/{name}", d / np.linalg.norm(d), self.now_ns, self.now_ns)

    def step(self):
        """One period of the stream."""
        self._work()
        self.now_ns += self.period_ns
        self._work()
        self.mission.tick(self.now_ns)
        self._stream()

    def stream_on(self, seconds):
        """The stream goes on while the machine is busy with a decision."""
        for _ in range(round(seconds * SECOND / self.period_ns)):
            self.now_ns += self.period_ns
            self._stream()

    def _stream(self):
        setpoint = self.mission.reference.stream(self.now_ns)
        if setpoint is not None:
            self.setpoints.append(setpoint)

    def run(self, seconds, *, until=lambda: False):
        """Periods for some seconds, or until something is so."""
        for _ in range(round(seconds * SECOND / self.period_ns)):
            self.step()
            if until():
                return

    def codes(self):
        """Codes of what was told so far."""
        return [event.code.name for event in self.events]

    def doing(self):
        """What is being streamed."""
        return self.mission.doing(self.now_ns)

    def _work(self):
        request = self.mission.take_wanted()
        if request is not None:
            self.solves += 1
            self._busy = (self.now_ns + self.solve_time_ns, request)
        if self._busy is not None and self._busy[0] <= self.now_ns:
            _, request = self._busy
            self._busy = None
            if request is self.mission.pending:
                self.mission.accept(carry_out(request), self.now_ns)
        self.events += self.mission.take_events()
        if self.mission.wanted is not None and self._busy is None:
            self._work_again()

    def _work_again(self):
        request = self.mission.take_wanted()
        self.solves += 1
        self._busy = (self.now_ns + self.solve_time_ns, request)


def discontinuities(setpoints, tolerance=1e-9):
    """Pairs of setpoints that no motion at their rates and accelerations joins.

    Between two setpoints of one segment the attitude turns by the integral of the rate; its
    trapezoidal rule is off by at most h^3 / 12 times the second derivative of the rate. A jump
    of a splice would stand out of that by its own size. The acceleration itself may jump at a
    splice, which shows in its departure from its trend.
    """
    from riem_planner.geometry import so3

    found = []
    trend = np.zeros(3)
    for before, after in pairwise(setpoints):
        h = (after.stamp_ns - before.stamp_ns) * 1e-9
        if float(before.quaternion @ after.quaternion) < 0.0:
            found.append((before, after, "sign"))
            trend = np.zeros(3)
            continue
        relative = so3.quaternion_multiply(
            so3.quaternion_conjugate(before.quaternion), after.quaternion
        )
        turned = so3.quaternion_log(relative)
        mean = 0.5 * h * (before.rate + after.rate) + h * h / 12 * (
            before.acceleration - after.acceleration
        )
        fastest = max(np.linalg.norm(before.rate), np.linalg.norm(after.rate))
        step = after.acceleration - before.acceleration
        change = max(np.linalg.norm(step), np.linalg.norm(step - trend))
        trend = step
        allowed = tolerance + h * h * (change + fastest**2) * 0.5
        if not np.any(before.rate) or not np.any(after.rate):
            # The motion begins or ends in between, and the rule cannot know when.
            allowed += 0.5 * h * fastest
        if np.linalg.norm(turned - mean) > allowed:
            found.append((before, after, "attitude"))
    return found
