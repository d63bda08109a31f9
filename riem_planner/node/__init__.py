# SPDX-License-Identifier: Apache-2.0
"""The planner as a ROS node: in a process of its own (`main`), or in one of yours.

from riem_planner.node import PlannerNode
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from riem_planner.node.planner_node import PlannerNode as PlannerNode

__all__ = ["PlannerNode"]


def __getattr__(name: str) -> Any:
    """Load the node when it is asked for: its imports take a second, in which signals count."""
    if name == "PlannerNode":
        from riem_planner.node.planner_node import PlannerNode

        return PlannerNode
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
