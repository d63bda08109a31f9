"""What the mission tells and holds: plans, events, measurements."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.mission.planning import Request
from riem_planner.mission.timeline import Segment
from riem_planner.problem import Problem
from riem_planner.solution import Solution

Array = NDArray[np.float64]


class Level(Enum):
    """How bad it is."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"


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


class Event(NamedTuple):
    """Something that users are told on ~/status.

    Attributes
    ----------
    level, code, message
        How bad it is, what it is in one word, and a sentence with numbers and advice.
    solution, problem
        What came of a solve, where one has ended.
    proposal
        A plan to show.
    """

    level: Level
    code: str
    message: str
    solution: Solution | None = None
    problem: Problem | None = None
    proposal: Proposal | None = None


class Measurement(NamedTuple):
    """Measured attitude: quaternion (4,), rate (3,) [rad/s], stamp [ns]."""

    quaternion: Array
    rate: Array
    stamp_ns: int
