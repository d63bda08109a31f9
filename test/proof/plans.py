# SPDX-License-Identifier: Apache-2.0
"""Honest plans that need no planner, and false ones made of them.

A curve is `R_0 exp(f(t) n_1) exp(g(t) n_2)` with cubic f and g, so that its rates and
accelerations are known; on S^2 it turns about one axis orthogonal to the boresight. Zones are put
at a chosen distance from the interpolant of its samples, by a search along `Trajectory`.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from riem_planner.geometry import so3, sphere
from riem_planner.trajectory import Trajectory

SAMPLES = ("times", "orientations_xyzw", "angular_velocities", "angular_accelerations")


@dataclass
class Case:
    """A problem and a plan, as documents, and the curve that the plan means."""

    problem: dict
    plan: dict
    trajectory: Trajectory

    def texts(self):
        """The two documents as JSON."""
        return json.dumps(self.problem), json.dumps(self.plan)


def unit(rng):
    """A random direction."""
    return normalised(rng.normal(size=3))


def normalised(x):
    """A vector over its norm."""
    return np.asarray(x) / np.linalg.norm(x)


def _cubic(start, end, T, t):
    """Angle from 0 with rates `start` and `end` and its two derivatives; (n,) each."""
    s = t / T
    h1, h2 = start * T, end * T
    value = (3 * s**2 - 2 * s**3) + h1 * (s - 2 * s**2 + s**3) + h2 * (s**3 - s**2)
    first = (6 * s - 6 * s**2) + h1 * (1 - 4 * s + 3 * s**2) + h2 * (3 * s**2 - 2 * s)
    second = (6 - 12 * s) + h1 * (6 * s - 4) + h2 * (6 * s - 2)
    return value, first / T, second / T**2


def curve(rng, pointing, samples):
    """A random curve as a `Trajectory`, and the boresight."""
    T = 10.0 ** rng.uniform(0.0, 3.0)
    t = np.linspace(0.0, T, samples)
    b = unit(rng)
    n1, n2 = unit(rng), unit(rng)
    q0 = normalised(rng.normal(size=4))
    moving = rng.random() < 0.5
    ends = rng.uniform(-1.0, 1.0, (2, 2)) / T if moving else np.zeros((2, 2))
    f, g = (
        [scale * x for x in _cubic(start, end, T, t)]
        for scale, (start, end) in zip(rng.uniform(0.3, 1.3, 2), ends, strict=True)
    )
    if pointing:
        n1, f = normalised(np.cross(b, unit(rng))), [1.8 * x for x in f]
        n2, g = b, [0.0 * x for x in g]
    back = so3.exp(-g[0][:, None] * n2)
    along = np.einsum("nij,j->ni", back, n1)
    v = f[1][:, None] * along + g[1][:, None] * n2
    a = f[2][:, None] * along + np.cross(f[1][:, None] * along, g[1][:, None] * n2)
    a = a + g[2][:, None] * n2
    q = so3.quaternion_multiply(
        so3.quaternion_multiply(np.broadcast_to(q0, (samples, 4)), half(f[0], n1)), half(g[0], n2)
    )
    return Trajectory(t, q / np.linalg.norm(q, axis=1)[:, None], v, a), b


def half(angle, axis):
    """Quaternions (n, 4) of turns about an axis."""
    return so3.quaternion_exp(np.asarray(angle)[:, None] * axis)


def extreme(function, T, sign):
    """Least (sign 1) or greatest (-1) value over [0, T]."""
    t = np.linspace(0.0, T, 400)
    values = sign * function(t)
    k = int(np.argmin(values))
    bounds = t[max(k - 1, 0)], t[min(k + 1, t.size - 1)]
    found = minimize_scalar(
        lambda x: sign * float(function(np.array([x]))[0]),
        bounds=bounds, method="bounded", options={"xatol": 1e-13 * T},
    )  # fmt: skip
    return sign * min(values[k], found.fun)


def place(direction, rate, t):
    """Where a turning direction is at times (n,)."""
    return np.einsum("nij,j->ni", so3.exp(t[:, None] * rate), direction)


def distance(trajectory, b, s, rate):
    """Angle between a boresight and a turning place, as a function of times (n,)."""

    def at(t):
        R = trajectory.evaluate(t)[0]
        return sphere.angle(np.einsum("nij,j->ni", R, b), place(s, rate, t))

    return at


def obstacle(rng, case_curve, b, name, margin):
    """A zone whose edge is `margin` from the curve, and negative where it is violated."""
    own = unit(rng) if b is None else b
    s = unit(rng)
    T = case_curve.duration
    rate = 0.5 * rng.normal(size=3) / T if rng.random() < 0.4 else np.zeros(3)
    kind = "keep_out" if rng.random() < 0.6 else "keep_in"
    at = distance(case_curve, own, s, rate)
    sign = 1 if kind == "keep_out" else -1
    radius = extreme(at, T, sign) - sign * margin
    if not 0.01 < radius < 3.1:
        return obstacle(rng, case_curve, b, name, margin)
    entry = {"name": name, "kind": kind, "direction": s.tolist(), "normalized_strength": 0.01}
    entry["half_angle_deg"] = math.degrees(radius)
    if b is None:
        entry["boresight"] = own.tolist()
    if rate.any():
        entry["rate"] = rate.tolist()
    return entry


def honest(rng, *, samples=9):
    """A random honest case; its clearances are claimed to within a tenth of a nanoradian."""
    pointing = rng.random() < 0.4
    trajectory, b = curve(rng, pointing, samples)
    T = trajectory.duration
    margins = 10.0 ** rng.uniform(-9.0, -0.5, rng.integers(0, 5))
    zones = [
        obstacle(rng, trajectory, b if pointing else None, f"z{i}", margin)
        for i, margin in enumerate(margins)
    ]
    problem = {"space": "s2" if pointing else "so3", "boresight": b.tolist(), "duration": T}
    for key, k in (("start", 0), ("goal", -1)):
        problem[key] = {
            "orientation": trajectory.quaternions_xyzw[k].tolist(),
            "angular_velocity": trajectory.angular_velocities[k].tolist(),
        }
    problem["obstacles"] = zones
    if rng.random() < 0.5:
        problem |= limits(rng, trajectory, 1.0 + 10.0 ** rng.uniform(-8.0, 0.0))
    plan = {key: getattr(trajectory, attribute).tolist() for key, attribute in zip(
        SAMPLES, ("times", "quaternions_xyzw", "angular_velocities", "angular_accelerations"),
        strict=True,
    )}  # fmt: skip
    plan["duration"] = T
    plan["clearance_deg"] = {
        zone["name"]: math.degrees(margin) - 1e-10
        for zone, margin in zip(zones, margins, strict=True)
    }
    return Case(problem, plan, trajectory)


def used(trajectory, quantity, J):
    """Greatest norm of a limited quantity along a curve."""

    def at(t):
        _, v, a = trajectory.evaluate(t)
        values = {
            "rate": v,
            "acceleration": a,
            "momentum": v @ J,
            "torque": a @ J + np.cross(v, v @ J),
        }
        return np.linalg.norm(values[quantity], axis=1)

    return extreme(at, trajectory.duration, -1)


def limits(rng, trajectory, share):
    """One limit of a random quantity, `share` times what the curve uses."""
    quantity = str(rng.choice(["rate", "acceleration", "momentum", "torque"]))
    J = np.diag(rng.uniform(1.0, 2.0, 3))
    return {
        "limits": {quantity: share * used(trajectory, quantity, J)},
        "inertia": J.ravel().tolist(),
    }


def false(rng, *, samples=9):
    """A case with one violation from 1e-9 rad (relative for limits) up, and its kind."""
    size = 10.0 ** rng.uniform(-9.0, -1.0)
    kind = str(rng.choice(["zone", "claim", "limit", "goal", "rate", "roll", "jump", "time"]))
    case = honest(rng, samples=samples)
    b = np.array(case.problem["boresight"])
    pointing = case.problem["space"] == "s2"
    T = case.trajectory.duration
    k = int(rng.integers(1, samples - 1))
    if kind == "zone":
        zone = obstacle(rng, case.trajectory, b if pointing else None, "bad", -1.05 * size - 1e-11)
        case.problem["obstacles"].append(zone)
    elif kind == "claim":
        zone = obstacle(rng, case.trajectory, b if pointing else None, "bad", 1e-3)
        case.problem["obstacles"].append(zone)
        case.plan["clearance_deg"]["bad"] = math.degrees(1e-3 + 1.2 * size)
    elif kind == "limit":
        case.problem |= limits(rng, case.trajectory, 1.0 - 2.0 * size - 1e-8)
    elif kind == "goal":
        # About an axis that the direction shows on s2.
        axis = normalised(np.cross(b, unit(rng)))
        turn = so3.quaternion_multiply(
            np.array(case.problem["goal"]["orientation"]), half(np.array([1.5 * size]), axis)[0]
        )
        case.problem["goal"]["orientation"] = turn.tolist()
    elif kind == "rate":
        axis = normalised(np.cross(b, unit(rng)))
        speed = np.linalg.norm(case.problem["goal"]["angular_velocity"])
        off = 3.0 * size * (1.0 / T + speed) * axis
        case.problem["goal"]["angular_velocity"] = (
            np.array(case.problem["goal"]["angular_velocity"]) + off
        ).tolist()
    elif kind == "roll" and pointing:
        fastest = np.linalg.norm(case.trajectory.angular_velocities, axis=1).max()
        v = np.array(case.plan["angular_velocities"][k]) + (
            b * (2e-6 + 0.01 * size) * (fastest + 1.0 / T)
        )
        case.plan["angular_velocities"][k] = v.tolist()
    elif kind == "time":
        case.plan["times"][k] = case.plan["times"][k - 1]
    else:
        kind = "jump"
        # Half of the samples turned by more than the rates can account for.
        h = T / (samples - 1)
        fastest = np.linalg.norm(case.trajectory.angular_velocities, axis=1).max()
        turn = half(np.array([0.3 * h * fastest + 0.01]), unit(rng))[0]
        q = np.array(case.plan["orientations_xyzw"])
        q[k:] = so3.quaternion_multiply(np.broadcast_to(turn, (samples - k, 4)), q[k:])
        case.plan["orientations_xyzw"] = q.tolist()
    return case, kind
