# SPDX-License-Identifier: Apache-2.0
"""What the mission tells and holds: plans, events, measurements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.mission.codes import Code, Level
from riem_planner.mission.planning import Goal, Request
from riem_planner.mission.timeline import Segment
from riem_planner.problem import Problem
from riem_planner.solution import Solution

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Proposal:
    """A certified plan, flown or shown.

    Parameters
    ----------
    segments
        The slew, and the stop after it if the goal is not at rest.
    request, solution, problem
        What was asked, what came, and the problem it solves.
    fresh
        It begins the stream, so it may begin at any time.
    """

    segments: tuple[Segment, ...]
    request: Request
    solution: Solution
    problem: Problem
    fresh: bool


@dataclass(frozen=True, eq=False)
class Event:
    """Something that users are told on ~/status.

    Parameters
    ----------
    code, message
        What it is in one word, and a sentence with numbers and advice.
    level
        How bad it is; None for what the code usually is.
    goal
        Whose outcome it is, if one goal's.
    start_ns, arrival_ns
        When what is flown or shown to that goal begins and arrives [ns].
    reason
        Why the goal was refused.
    solution, problem
        What came of a solve, where one has ended.
    proposal
        A plan to show.
    topic
        Where the message came from that was refused, if it is not a goal's.
    """

    code: Code
    message: str
    level: Level | None = None
    goal: Goal | None = None
    start_ns: int | None = None
    arrival_ns: int | None = None
    reason: str = ""
    solution: Solution | None = None
    problem: Problem | None = None
    proposal: Proposal | None = None
    topic: str = ""

    @property
    def severity(self) -> Level:
        """How bad it is."""
        return self.code.level if self.level is None else self.level


class Measurement(NamedTuple):
    """Measured attitude: quaternion (4,), rate (3,) [rad/s], stamp [ns]."""

    quaternion: Array
    rate: Array
    stamp_ns: int
