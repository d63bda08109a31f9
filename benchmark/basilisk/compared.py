# SPDX-License-Identifier: Apache-2.0
"""Basilisk's constrained-manoeuvre module and we, on its own four cases, at its durations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tqdm import tqdm

from benchmark.basilisk.measures import (
    Effort,
    between_samples,
    effort,
    margins,
    rigid_torque,
)
from benchmark.basilisk.peer import COSTS, manoeuvre
from benchmark.basilisk.plant import STEP, fly
from benchmark.basilisk.published import HOLD, PROBLEMS, craft_of
from benchmark.basilisk.reference import Reference, streamed
from benchmark.report import Table
from riem_planner import Problem, solve
from riem_planner.files.problem_files import read_problem
from riem_planner.geometry import so3

REFINEMENTS = range(4, 11)  # N of the grid; the scenario's is 8
_REACHED = np.radians(0.1)
_SHARE = 0.9  # of the module's margins, by which zones are enlarged to compare at like margins


@dataclass(frozen=True)
class Side:
    """How one of the two did.

    Parameters
    ----------
    margins
        Least distance of the true attitudes to each forbidden set [rad].
    flown, stated
        Effort of the wheels' torques as flown, and of `J v' + v x J v` of the reference.
    solve_time
        [s].
    reached
        Whether the flight ends at the goal.
    """

    margins: dict[str, float]
    flown: Effort
    stated: Effort
    solve_time: float
    reached: bool

    @property
    def margin(self) -> float:
        """To the closest zone [rad]."""
        return min(self.margins.values())

    @property
    def fault(self) -> str:
        """What is wrong with it, in a few words; empty if nothing is."""
        if not self.reached:
            return "misses the goal"
        entered = [name for name, margin in self.margins.items() if margin <= 0.0]
        return f"enters {', '.join(entered)}" if entered else ""


@dataclass(frozen=True)
class Run:
    """One case, one grid; `like` is ours past zones enlarged by most of the module's margins."""

    case: str
    refinement: int
    duration: float
    theirs: Side
    ours: Side
    like: Side | None

    @property
    def square_ratio(self) -> float:
        """Our integral of the squared wheel torque, by theirs."""
        return self.ours.flown.square / self.theirs.flown.square

    @property
    def norm_ratio(self) -> float:
        """Our integral of the wheel torque's norm, by theirs."""
        return self.ours.flown.norm / self.theirs.flown.norm

    def row(self) -> dict[str, object]:
        """Of the table."""
        theirs, ours = self.theirs, self.ours
        return {
            "case": self.case.removeprefix("bevo2_"),
            "N": self.refinement,
            "T [s]": self.duration,
            "theirs: clearance [deg]": float(np.degrees(theirs.margin)),
            "theirs: fault": theirs.fault,
            "ours: clearance [deg]": float(np.degrees(ours.margin)),
            "theirs: ∫\\|u\\|²": theirs.flown.square,
            "ours: ∫\\|u\\|²": ours.flown.square,
            "theirs: ∫\\|u\\|": theirs.flown.norm,
            "ours: ∫\\|u\\|": ours.flown.norm,
            "theirs: time [ms]": 1e3 * theirs.solve_time,
            "ours: time [ms]": 1e3 * ours.solve_time,
        }


def compared() -> tuple[list[Table], list[str]]:
    """A summary, a table for each cost of the module, and the bars that we miss."""
    problems = [read_problem(path) for path in sorted(PROBLEMS.glob("bevo2_*.yaml"))]
    sets = {cost: _runs(problems, cost) for cost in COSTS}
    tables = [_summary(sets)]
    for cost, runs in sets.items():
        table = Table(
            f"Side by side, the module minimising {cost}",
            "Clearance: least of the true attitudes; negative: how deep in a zone; ours is a lower"
            f" bound. u [N m] is the torque of the wheels on the body, until {HOLD:g} s after the"
            " end.",
            [run.row() for run in runs],
        )
        tables.append(table)
    missed = [fault for cost, runs in sets.items() for fault in _missed(cost, runs)]
    return tables, missed


def _missed(cost: str, runs: list[Run]) -> list[str]:
    missed = []
    for run in runs:
        name = f"{run.case}, {cost}, N = {run.refinement}"
        for side in (run.ours, run.like):
            if side is not None and side.fault:
                missed.append(f"{name}: our slew: {side.fault}")
        if not run.theirs.fault and run.square_ratio > 1.0:
            missed.append(f"{name}: our squared torque is {run.square_ratio:.3g} times theirs")
    return missed


def _summary(sets: dict[str, list[Run]]) -> Table:
    table = Table(
        "Basilisk's constrained-manoeuvre module and we: summary",
        "Ratios are ours by theirs over the module's runs without fault, u the wheels' torque as"
        " flown. Like margins: ours past zones enlarged by"
        f" {_SHARE:g} of the module's margins. Stated: `J v' + v x J v` of the references, the"
        " module's own measure.",
    )
    for cost, runs in sets.items():
        sound = [run for run in runs if not run.theirs.fault]
        squares = [run.square_ratio for run in sound]
        stated = [run.ours.stated.norm / run.theirs.stated.norm for run in sound]
        like = [run.like.flown.square / run.theirs.flown.square for run in sound if run.like]
        table.rows.append(
            {
                "the module minimises": cost,
                "runs": len(runs),
                "theirs with a fault": len(runs) - len(sound),
                "ours with a fault": sum(bool(run.ours.fault) for run in runs),
                "∫\\|u\\|², median": float(np.median(squares)),
                "∫\\|u\\|², largest": max(squares),
                "∫\\|u\\|, largest": max(run.norm_ratio for run in sound),
                "like margins ∫\\|u\\|², largest": max(like),
                "stated ∫\\|u\\|², largest": max(
                    run.ours.stated.square / run.theirs.stated.square for run in sound
                ),
                "stated ∫\\|u\\|, largest": max(stated),
            }
        )
    return table


def _runs(problems: list[Problem], cost: str) -> list[Run]:
    pairs = [(problem, N) for problem in problems for N in REFINEMENTS]
    return [_run(*pair, cost) for pair in tqdm(pairs, desc=f"minimising {cost}", leave=False)]


def _run(problem: Problem, refinement: int, cost: str) -> Run:
    """Plan by both, at the module's duration, and fly both."""
    planned = manoeuvre(problem, craft_of(problem).inertia, refinement, cost, HOLD)
    same = replace(problem, duration=planned.duration)
    theirs = _side(same, planned.reference, planned.solve_time, proven=False)
    return Run(
        case=problem.name,
        refinement=refinement,
        duration=planned.duration,
        theirs=theirs,
        ours=_our_side(same),
        like=None if theirs.fault else _our_side(_enlarged(same, theirs.margins)),
    )


def _enlarged(problem: Problem, margins: dict[str, float]) -> Problem:
    """The problem with every forbidden set larger by most of a margin [rad] to it."""
    zones = []
    for zone in problem.obstacles:
        by = _SHARE * margins[str(zone.group or zone.name)]
        grown = zone.half_angle + (by if zone.kind == "keep_out" else -by)
        zones.append(replace(zone, half_angle=grown))
    return replace(problem, obstacles=tuple(zones))


def _our_side(problem: Problem) -> Side:
    solution = solve(problem)
    if solution.trajectory is None:
        raise RuntimeError(f"{problem.name}, {problem.duration:.6g} s: {solution.message}")
    reference = streamed(solution.trajectory, STEP, hold=HOLD)
    return _side(problem, reference, solution.solve_time, proven=True)


def _side(problem: Problem, reference: Reference, solve_time: float, *, proven: bool) -> Side:
    """Fly a reference; `proven` lowers the margin by what may lie between two samples."""
    craft = craft_of(problem)
    flown = fly(craft, problem, reference)
    slack = between_samples(flown.rates, STEP) if proven else 0.0
    off = so3.quaternion_distance(flown.quaternions[-1], problem.goal.quaternion_xyzw)
    return Side(
        margins={
            name: margin - slack for name, margin in margins(problem, flown.quaternions).items()
        },
        flown=effort(flown.torques, STEP),
        stated=effort(rigid_torque(craft.inertia, *reference.body()), STEP),
        solve_time=solve_time,
        reached=bool(off < _REACHED),
    )
