# SPDX-License-Identifier: Apache-2.0
"""The states of the mission, and what leads from one to another: tables, and nothing else.

A happening that a state has no row for is a fault of the caller, and raises.
"""

from __future__ import annotations

from enum import Enum


class Life(Enum):
    """Whether the node plans and streams."""

    NEW = "not active yet: what is told is kept, a goal too where the node starts by itself"
    INACTIVE = "not active: what is told of the world is kept, goals are refused"
    ACTIVE = "it plans and streams"
    ENDING = "it comes to rest, to be deactivated: goals are refused"


class Order(Enum):
    """What the life cycle asks for."""

    ACTIVATE = "activate"
    END = "come to rest"
    DEACTIVATE = "deactivate"


LIFE: dict[tuple[Life, Order], Life] = {
    (Life.NEW, Order.ACTIVATE): Life.ACTIVE,
    (Life.NEW, Order.END): Life.NEW,
    (Life.NEW, Order.DEACTIVATE): Life.NEW,
    (Life.INACTIVE, Order.ACTIVATE): Life.ACTIVE,
    (Life.INACTIVE, Order.END): Life.INACTIVE,
    (Life.INACTIVE, Order.DEACTIVATE): Life.INACTIVE,
    (Life.ACTIVE, Order.ACTIVATE): Life.ACTIVE,
    (Life.ACTIVE, Order.END): Life.ENDING,
    (Life.ACTIVE, Order.DEACTIVATE): Life.INACTIVE,
    (Life.ENDING, Order.ACTIVATE): Life.ACTIVE,
    (Life.ENDING, Order.END): Life.ENDING,
    (Life.ENDING, Order.DEACTIVATE): Life.INACTIVE,
}


class Phase(Enum):
    """What is flown, and whether it goes to the goal."""

    IDLE = "nothing is streamed"
    BOUND = "what flies goes to the goal"
    ASIDE = "what flies does not go there: a stop, a dodge, the way to a former goal"
    LEAVING = "on the way out of a zone"
    RETURNING = "on the way out of a zone, and then to the goal"


class Happening(Enum):
    """What changes it."""

    FLY = "a certified plan is flown"
    TURN = "another goal counts, or none"
    RESCUE = "a certified stop or dodge takes its place"
    WAY_OUT = "a way out takes its place"
    CLEAR = "it has left the zone"
    PART = "the target has fallen silent"
    DROP = "nothing has begun, and nothing is flown"


COURSE: dict[tuple[Phase, Happening], Phase] = {
    (Phase.IDLE, Happening.FLY): Phase.BOUND,
    (Phase.IDLE, Happening.TURN): Phase.IDLE,
    (Phase.IDLE, Happening.DROP): Phase.IDLE,
    (Phase.BOUND, Happening.FLY): Phase.BOUND,
    (Phase.BOUND, Happening.TURN): Phase.ASIDE,
    (Phase.BOUND, Happening.RESCUE): Phase.ASIDE,
    (Phase.BOUND, Happening.WAY_OUT): Phase.LEAVING,
    (Phase.BOUND, Happening.PART): Phase.ASIDE,
    (Phase.BOUND, Happening.DROP): Phase.IDLE,
    (Phase.ASIDE, Happening.FLY): Phase.BOUND,
    (Phase.ASIDE, Happening.TURN): Phase.ASIDE,
    (Phase.ASIDE, Happening.RESCUE): Phase.ASIDE,
    (Phase.ASIDE, Happening.WAY_OUT): Phase.LEAVING,
    (Phase.ASIDE, Happening.DROP): Phase.IDLE,
    (Phase.LEAVING, Happening.FLY): Phase.RETURNING,
    (Phase.LEAVING, Happening.TURN): Phase.LEAVING,
    (Phase.LEAVING, Happening.RESCUE): Phase.ASIDE,
    (Phase.LEAVING, Happening.WAY_OUT): Phase.LEAVING,
    (Phase.LEAVING, Happening.CLEAR): Phase.ASIDE,
    (Phase.LEAVING, Happening.DROP): Phase.IDLE,
    (Phase.RETURNING, Happening.FLY): Phase.RETURNING,
    (Phase.RETURNING, Happening.TURN): Phase.LEAVING,
    (Phase.RETURNING, Happening.RESCUE): Phase.ASIDE,
    (Phase.RETURNING, Happening.WAY_OUT): Phase.LEAVING,
    (Phase.RETURNING, Happening.CLEAR): Phase.BOUND,
    (Phase.RETURNING, Happening.PART): Phase.LEAVING,
    (Phase.RETURNING, Happening.DROP): Phase.IDLE,
}


def diagram() -> str:
    """The table of what is flown, as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", "    [*] --> IDLE"]
    arrows: dict[tuple[Phase, Phase], list[str]] = {}
    for (phase, happening), then in COURSE.items():
        if phase is not then:
            arrows.setdefault((phase, then), []).append(happening.name)
    for (phase, then), names in arrows.items():
        lines.append(f"    {phase.name} --> {then.name}: {', '.join(names)}")
    return "\n".join(lines) + "\n"
