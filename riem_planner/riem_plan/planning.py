# SPDX-License-Identifier: Apache-2.0
"""From a problem to what is published: solve, resample evenly, certify again."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from riem_planner.certificate import certify
from riem_planner.files.plans import Plan, with_duration_of
from riem_planner.geometry import so3
from riem_planner.hold import hold_trajectory
from riem_planner.problem import LEAST_ACCELERATION, LEAST_TIME, Problem
from riem_planner.riem_plan.least_torque import check_least_torque, with_least_torque
from riem_planner.solution import Solution, Status
from riem_planner.solve import solve
from riem_planner.trajectory import Trajectory

DEFAULT_SAMPLES = 201
LEAST_SAMPLES = 21  # of a plan of least time, in which a switch takes an interval
_DEVIATION = 1e-4  # rad between samples, beyond which a plan is no longer the one solved for
_DOUBLINGS = 4  # of the samples, before the certificate of the samples is given up


def plan_problem(
    problem: Problem, samples: int = DEFAULT_SAMPLES, *, least_torque: bool = False
) -> Plan:
    """Plan a problem; what can't be planned is a value, as in `solve`.

    Parameters
    ----------
    problem
        What to solve.
    samples
        Number of evenly spaced samples, at least 2. Between them a plan means the quintic of
        `Trajectory`, so few samples are another trajectory than was solved for: if its
        certificate fails, the number is doubled, up to four times.
    least_torque
        Whether to minimise torque, from the paths of least acceleration on.

    Raises
    ------
    InvalidProblemError
        Torque is to be minimised, and the problem has no inertia or is on s2.
    """
    if least_torque:
        check_least_torque(problem)
    if problem.objective == LEAST_TIME:
        return _least_time(problem, samples)
    solution = solve(problem)
    if not solution.solved or solution.trajectory is None:
        return Plan(problem, solution)
    problem = with_duration_of(problem, solution.trajectory)
    if least_torque:
        solution = with_least_torque(problem, solution)
    return _publish(problem, solution, samples)


def _least_time(problem: Problem, samples: int) -> Plan:
    """The plan of a problem of least time, which is found on the samples of the plan."""
    solution = solve(problem, samples=max(samples, LEAST_SAMPLES))
    if solution.trajectory is None:
        return Plan(problem, solution)
    timed = problem.timed(solution.trajectory.duration, problem.limits)
    if solution.level == LEAST_ACCELERATION:
        return replace(_publish(timed, solution, samples), stated=problem)
    notes = solution.notes
    if solution.trajectory.times.size != samples:
        notes += (f"{solution.trajectory.times.size} samples instead of {samples}",)
    hold = hold_trajectory(timed.with_goal(solution.goal_index or 0), solution.trajectory)
    return Plan(
        timed,
        replace(solution, notes=notes),
        solution.trajectory,
        solution.certificate,
        hold,
        stated=problem,
    )


def _sampling_notes(solved: Trajectory, sampled: Trajectory, asked: int) -> list[str]:
    notes = []
    count = sampled.times.size
    if count != asked:
        notes.append(f"{count} samples instead of {asked}, which could not be certified")
    between = 0.5 * (sampled.times[1:] + sampled.times[:-1])
    q, planned = sampled.evaluate_quaternion(between)[0], solved.evaluate_quaternion(between)[0]
    deviation = float(np.max(so3.quaternion_distance(q, planned)))
    if deviation > _DEVIATION:
        notes.append(
            f"{count} samples leave the least-cost path by up to {math.degrees(deviation):.3g} deg"
        )
    return notes


def _publish(problem: Problem, solution: Solution, samples: int) -> Plan:
    assert solution.trajectory is not None
    count = samples
    for _ in range(_DOUBLINGS + 1):
        sampled = solution.trajectory.resampled(count)
        certificate = certify(sampled, problem)
        if certificate.certified:
            notes = (*solution.notes, *_sampling_notes(solution.trajectory, sampled, samples))
            reached = problem.with_goal(solution.goal_index or 0)
            hold = hold_trajectory(reached, sampled)
            return Plan(problem, replace(solution, notes=notes), sampled, certificate, hold)
        count = 2 * count - 1
    refused = replace(
        solution,
        status=Status.NO_CERTIFIED_TRAJECTORY,
        message=(
            f"no certified trajectory: one was found, but none of up to {(count + 1) // 2} even"
            f" samples: {'; '.join(certificate.reasons)}; ask for more samples"
        ),
        trajectory=None,
        certificate=certificate,
    )
    return Plan(problem, refused, certificate=certificate)
