# SPDX-License-Identifier: Apache-2.0
"""Cubics without tension and obstacles, against published values and a peer with its own method."""

import json
from pathlib import Path

import numpy as np
import pytest

from riem_planner import Problem, State, solve
from riem_planner.geometry import so3
from riem_planner.manifolds import GeneralProblem, GeneralState
from riem_planner.manifolds.lie_groups import special_orthogonal

# Segments of the natural cubic through the keyframes of interpolatepy's documentation, by an
# independent multiple-shooting solution of v''' + [v, v''] = 0; quaternions w, x, y, z.
SEGMENTS = json.loads((Path(__file__).parent / "natural_cubic.json").read_text())["segments"]


def state(segment, end):
    w, x, y, z = segment[f"q{end}_wxyz"]
    q = np.array([x, y, z, w])
    return State.from_quaternion_xyzw(q / np.linalg.norm(q), segment[f"v{end}_body"])


def middle(segment):
    w, x, y, z = segment["q_mid_wxyz"]
    return np.array([x, y, z, w])


@pytest.mark.parametrize("segment", SEGMENTS, ids=["0", "1", "2"])
def test_published_natural_cubic(segment):
    problem = Problem(state(segment, 0), state(segment, 1), segment["T"])
    trajectory = solve(problem, tolerance=1e-11).trajectory
    q, _, a = trajectory.evaluate_quaternion(0.5 * segment["T"])
    assert so3.quaternion_distance(q, middle(segment)) < 1e-9
    np.testing.assert_allclose(a, segment["a_mid_body"], atol=1e-7)


def test_published_natural_cubic_through_the_general_path():
    segment = SEGMENTS[1]
    start, goal = (
        GeneralState(s.orientation, s.angular_velocity)
        for s in (state(segment, 0), state(segment, 1))
    )
    problem = GeneralProblem(special_orthogonal(3), start, goal, segment["T"])
    g, _, a = solve(problem, search="local").trajectory.evaluate(0.5 * segment["T"])
    assert so3.distance(g, so3.quaternion_to_matrix(middle(segment))) < 1e-9
    np.testing.assert_allclose(a, segment["a_mid_body"], atol=1e-8)
