# SPDX-License-Identifier: Apache-2.0
"""Every code of ~/status: how bad it is, whether it is a goal's end, and a sentence about it."""

from __future__ import annotations

from enum import Enum

from riem_planner.solution import Status


class Level(Enum):
    """How bad it is."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"


class Code(Enum):
    """What became of a goal, or of what flies, in one word.

    Attributes
    ----------
    level
        How bad it usually is; an event may be worse.
    ends
        Whether it is the last that is told of a goal.
    sentence
        When it is told, or what to do about it.
    """

    WAITING = (Level.WARN, False, "the goal is kept; the message says for what it waits")
    SHOWN = (Level.OK, False, "planned and certified, not flown: auto_execute is false")
    FLYING = (Level.OK, False, "certified and flown, with its times; told again after a replan")
    LATE = (Level.WARN, False, "a plan or a stop came too late; it is planned again")
    OVERTAKEN = (Level.WARN, False, "the world changed while it was planned; it is planned again")
    STOP = (
        Level.WARN,
        False,
        "an obstacle, or a target that fell silent, made it stop; goal stays",
    )
    DODGE = (Level.WARN, False, "an obstacle made it turn aside; the goal stays")
    WAY_OUT = (Level.ERROR, False, "inside a zone: it takes the way out; the goal stays")
    CLOCK_JUMP = (Level.WARN, False, "the clock was set; the times that were told have moved")
    INVALID = (Level.ERROR, False, "the goal can't be planned to as told; tried each second")
    START_IN_ZONE = (Level.ERROR, False, Status.START_IN_ZONE.advice)
    GOAL_IN_ZONE = (Level.ERROR, False, Status.GOAL_IN_ZONE.advice)
    NO_CERTIFIED_TRAJECTORY = (Level.ERROR, False, Status.NO_CERTIFIED_TRAJECTORY.advice)
    LIMITS_EXCEEDED = (Level.ERROR, False, Status.LIMITS_EXCEEDED.advice)
    OUT_OF_TIME = (Level.ERROR, False, Status.OUT_OF_TIME.advice)
    ARRIVED = (Level.OK, True, "the setpoint of its arrival time has been streamed")
    REPLACED = (Level.OK, True, "another goal came")
    CANCELLED = (Level.OK, True, "given up by ~/cancel, deactivation or shutdown")
    REFUSED = (Level.ERROR, True, "the message can't be used, for the reason given")

    def __init__(self, level: Level, ends: bool, sentence: str) -> None:
        self.level = level
        self.ends = ends
        self.sentence = sentence


def code_of(status: Status) -> Code:
    """The code of a solve that gave no plan."""
    return Code[status.name]
