# SPDX-License-Identifier: Apache-2.0
"""Natural cubics of `interpolatepy` (PyPI, tests only), which shoots on its own equations."""

import numpy as np
import pytest

from riem_planner import Problem, State, solve
from riem_planner.geometry import so3

interpolatepy = pytest.importorskip("interpolatepy")


def peer(times, quaternions):
    config = interpolatepy.ShootingConfig(tolerance=1e-10, integration_steps=256)
    keyframes = [interpolatepy.Quaternion(float(q[3]), *map(float, q[:3])) for q in quaternions]
    return interpolatepy.ShootingQuaternionInterpolation(list(times), keyframes, config)


def attitude(spline, t):
    q = spline.evaluate(t)
    values = np.array([q.x, q.y, q.z, q.w])
    return values / np.linalg.norm(values)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_segments_of_a_natural_cubic_agree_to_1e_9(seed):
    rng = np.random.default_rng(seed)
    times = [0.0, 1.0, 2.2]
    spline = peer(times, so3.quaternion_exp(0.8 * rng.normal(size=(3, 3))))
    for begin, end in ((0.0, 1.0), (1.0, 2.2)):
        states = [
            State.from_quaternion_xyzw(
                attitude(spline, t), np.asarray(spline.evaluate_velocity(t), dtype=float)
            )
            for t in (begin, end)
        ]
        solution = solve(Problem(*states, end - begin), tolerance=1e-11)
        for s in np.linspace(0.1, 0.9, 5) * (end - begin):
            q = solution.trajectory.evaluate_quaternion(s)[0]
            assert so3.quaternion_distance(q, attitude(spline, begin + s)) < 1e-9
