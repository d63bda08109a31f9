# SPDX-License-Identifier: Apache-2.0
"""One random life of a mission, and what an independent observer of its setpoints notes.

The observer uses nothing of the certificate or of the mission's world: only the messages that
were sent, and formulas of its own.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from geometry_msgs.msg import Pose, PoseArray
from inbox import Inbox
from simulation import SECOND, Simulation, settings
from spoiled import BODY, FRAME, spoiled

from msg_adapters import geometry
from riem_planner.geometry import so3

BUDGET = 0.1
RADIUS = 0.2
PERIOD = 0.05
X = np.array([1.0, 0.0, 0.0])
FASTEST = 0.02  # rad/s; of zones and obstacles
ROUNDING = 1e-7  # rad
CONTINUOUS = 1e-9  # of quaternions, and of rates [rad/s], at a splice


def _unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def _turning(rng):
    return rng.uniform(0.0, FASTEST) * _unit(rng)


def _pointing(quaternion, boresight):
    """Direction of a body axis, by the double cross product."""
    vector, w = quaternion[:3], quaternion[3]
    t = 2.0 * np.cross(vector, boresight)
    return boresight + w * t + np.cross(vector, t)


@dataclass
class Sky:
    """A zone as the world has it: it moves, and is told of now and then."""

    name: str
    keeps_in: bool
    half_angle: float
    boresight: np.ndarray
    direction: np.ndarray
    turning: np.ndarray
    wanders: bool
    told: list = field(default_factory=list)  # (time, direction)

    def parameters(self):
        """Of the node; the rate of a zone that wanders has to be estimated."""
        values = {
            "kind": "keep_in" if self.keeps_in else "keep_out",
            "half_angle": self.half_angle,
            "boresight": self.boresight.tolist(),
            "direction": self.direction.tolist(),
            "rate": [] if self.wanders else self.turning.tolist(),
            "max_speed": 2.0 * FASTEST,
        }
        return {f"{self.name}__{key}": value for key, value in values.items()}

    def move(self, rng, quaternion):
        """Turn on for one period; one that wanders turns another way every few seconds.

        Half the time it then comes for the spacecraft at this attitude (or leaves it outside).
        """
        if self.wanders and rng.random() < 0.02:
            self.turning = _turning(rng)
            if quaternion is not None and rng.random() < 0.5:
                toward = np.cross(self.direction, _pointing(quaternion, self.boresight))
                toward *= (-1.0 if self.keeps_in else 1.0) / max(np.linalg.norm(toward), 1e-9)
                self.turning = np.linalg.norm(self.turning) * toward
        self.direction = so3.exp(self.turning * PERIOD) @ self.direction

    def beside(self, margin, rng):
        """An attitude (4,) that is clear of the zone by a margin [rad], on a random side."""
        off = self.half_angle - margin if self.keeps_in else self.half_angle + margin
        side = np.cross(self.direction, _unit(rng))
        pointing = so3.exp(off * side / np.linalg.norm(side)) @ self.direction
        roll = so3.quaternion_exp(rng.uniform(-np.pi, np.pi) * self.boresight)
        return so3.quaternion_multiply(so3.minimal_rotation(self.boresight, pointing), roll)

    def depth(self, setpoint):
        """How far inside the forbidden set a setpoint is [rad], as last told a budget before."""
        known = setpoint.stamp_ns - BUDGET * SECOND
        direction = next((d for t, d in reversed(self.told) if t <= known), None)
        if direction is None:
            return -np.inf
        axis = _pointing(setpoint.quaternion, self.boresight)
        sine = np.linalg.norm(np.cross(axis, direction))
        angle = np.arctan2(sine, float(axis @ direction))
        inside = angle - self.half_angle if self.keeps_in else self.half_angle - angle
        # It has moved on since it was told; a setpoint just behind it is not inside.
        age = (setpoint.stamp_ns - self.told[-1][0]) * 1e-9
        return inside - FASTEST * (age + BUDGET)


def _skies(rng, space):
    """One to three zones with half-angles of their own, the second and third clear at the start."""
    skies = [Sky("sun", False, 0.35, X, _unit(rng), _turning(rng), rng.random() < 0.5)]
    for name, keeps_in, share, least, most in (
        ("moon", False, 0.5, 0.1, 0.3),
        ("earth", True, 0.3, 1.0, 1.5),
    ):
        if rng.random() >= share:
            continue
        half_angle = float(rng.uniform(least, most))
        boresight = X if space == "s2" else _unit(rng)
        direction = _unit(rng)
        off = float(np.arccos(boresight @ direction))
        if (off > half_angle - 0.3) if keeps_in else (off < half_angle + 0.2):
            direction = -direction
        wanders = rng.random() < 0.5
        sky = Sky(name, keeps_in, half_angle, boresight, direction, _turning(rng), wanders)
        off = float(np.arccos(boresight @ direction))
        if (off < half_angle - 0.3) if keeps_in else (off > half_angle + 0.2):
            skies.append(sky)
    return skies


class Episode:
    """A mission with goals, moving zones and obstacles, cancels, late plans and bad messages."""

    def __init__(self, seed, space="so3"):
        self.rng = rng = np.random.default_rng(seed)
        self.skies = _skies(rng, space)
        values = {}
        for sky in self.skies:
            values.update(sky.parameters())
        parameters = settings(
            tuple(sky.name for sky in self.skies),
            space=space,
            duration=float(rng.uniform(5.0, 20.0)),
            planning_budget=BUDGET,
            obstacle_radius=RADIUS,
            **values,
        )
        self.simulation = Simulation(
            parameters, solve_time=float(rng.uniform(0.001, 0.06)), period=PERIOD
        )
        self.inbox = Inbox(self.simulation)
        self._free = 1.0 - X if space == "s2" else np.ones(3)  # on s2 there is no rate of roll
        self.obstacle = None  # an attitude that drifts as well
        self.orientations = []  # (time, quaternion)
        self.drift = _turning(rng)
        if space == "so3" and rng.random() < 0.5:
            self.obstacle = _quaternion(rng)
        self.faults = []
        self.jumps = []
        self.splices = 0
        self._timeline = None
        self.excused = self.checked = self.spoiled = 0
        self._begin = self.simulation.now_ns

    def run(self, seconds):
        """Live on for some time."""
        simulation, rng = self.simulation, self.rng
        self._tell()
        for _ in range(round(seconds / PERIOD)):
            here = simulation.setpoints[-1].quaternion if simulation.setpoints else None
            for sky in self.skies:
                sky.move(rng, here)
            self._ask(rng.random())
            if rng.random() < 0.2:
                self._tell()
            if rng.random() < 0.05:
                self._spoil()
            count = len(simulation.setpoints)
            simulation.step()
            self._check_splices()
            for setpoint in simulation.setpoints[count:]:
                self._check(setpoint)
        return self

    def forget(self):
        """Throw away what an observer keeps of the past."""
        self.simulation.setpoints = self.simulation.setpoints[-1:]
        self.simulation.events.clear()
        self.inbox.rejected.clear()
        self.orientations = self.orientations[-50:]
        for sky in self.skies:
            sky.told = sky.told[-50:]

    def _goal(self):
        """Anywhere, or just outside of what is forbidden by one of the zones."""
        if self.rng.random() < 0.3:
            return _quaternion(self.rng)
        sky = self.skies[self.rng.integers(len(self.skies))]
        return sky.beside(self.rng.uniform(0.02, 0.15), self.rng)

    def _ask(self, dice):
        simulation = self.simulation
        if dice < 0.005:
            self.inbox.send("goal", geometry.pose_from_attitude(self._goal(), 0, FRAME))
        elif dice < 0.006:
            frames, rate = (FRAME, BODY), 0.03 * self.rng.normal(size=3) * self._free
            state = geometry.odometry_from_attitude(self._goal(), rate, 0, frames)
            self.inbox.send("goal_state", state)
        elif dice < 0.007:
            simulation.mission.cancel(simulation.now_ns)
        elif dice < 0.010:
            simulation.mission.replan(simulation.now_ns)

    def _tell(self):
        now_ns = self.simulation.now_ns
        elapsed = (now_ns - self._begin) * 1e-9
        for sky in self.skies:
            message = geometry.vector_from_direction(3.0 * sky.direction, now_ns, FRAME)
            self.inbox.send(f"zones/{sky.name}", message)
            sky.told.append((now_ns, sky.direction))
        if self.obstacle is None or len(self.skies[0].told) <= 20:
            return  # an obstacle comes after the first plan
        q = so3.quaternion_multiply(so3.quaternion_exp(self.drift * elapsed), self.obstacle)
        here = self.simulation.setpoints[-1:]
        far = not here or so3.quaternion_distance(here[0].quaternion, q) > 4 * RADIUS
        if self.orientations or far:  # it leaves time to stop when it appears
            poses = [Pose(orientation=geometry.quaternion_to_message(q))]
            header = geometry.header(now_ns, FRAME)
            self.inbox.send("obstacles", PoseArray(header=header, poses=poses))
            self.orientations.append((now_ns, q))

    def _state(self):
        mission = self.simulation.mission
        known = (mission.goal, mission.timeline, mission.pending, mission.wanted, mission.measured)
        return (*known, mission.shown, mission.world.version, mission.leaving)

    def _spoil(self):
        """A bad message is refused, and nothing changes."""
        names = ["goal", "goal_state", "state", "imu", "obstacles"]
        name = str(self.rng.choice([*names, *(f"zones/{sky.name}" for sky in self.skies)]))
        before, count = self._state(), len(self.inbox.rejected)
        self.inbox.send(name, spoiled(name, self.rng, self.simulation.now_ns))
        assert len(self.inbox.rejected) == count + 1, name
        for was, now in zip(before, self._state(), strict=True):
            assert was is now or was == now, name
        self.spoiled += 1

    def _check(self, setpoint):
        self.checked += 1
        for sky in self.skies:
            self._note(setpoint, sky.name, sky.depth(setpoint))
        known = setpoint.stamp_ns - BUDGET * SECOND
        q = next((q for t, q in reversed(self.orientations) if t <= known), None)
        if q is not None:
            angle = 2 * np.arccos(min(1.0, abs(float(q @ setpoint.quaternion))))
            age = (setpoint.stamp_ns - self.orientations[-1][0]) * 1e-9
            moved = np.linalg.norm(self.drift) * (age + BUDGET)
            self._note(setpoint, "obstacle", RADIUS - angle - moved)

    def _check_splices(self):
        """Attitude, its sign, and rate go on where one segment takes over from another."""
        timeline = self.simulation.mission.timeline
        if timeline is self._timeline:
            return
        self._timeline = timeline
        for before, after in pairwise(timeline.segments):
            # What begins just when a segment ends goes on from its last state: that segment is
            # held at rest only if nothing follows.
            until_ns = after.start_ns - (after.start_ns == before.end_ns)
            was, now = before.at(until_ns), after.at(after.start_ns)
            turned = np.abs(was.quaternion - now.quaternion).max()
            jump = max(turned, np.abs(was.rate - now.rate).max())
            self.splices += 1
            if jump > CONTINUOUS:
                self.jumps.append((after.start_ns - self._begin, float(jump)))

    def _note(self, setpoint, name, depth):
        if depth <= ROUNDING:
            return
        if self.simulation.mission.leaving:
            self.excused += 1
        else:
            self.faults.append((setpoint.stamp_ns - self._begin, name, float(depth)))
