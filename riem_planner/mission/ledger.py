# SPDX-License-Identifier: Apache-2.0
"""What is told of goals: events in their order, and exactly one end for each goal."""

from __future__ import annotations

from riem_planner.mission.codes import Code, Level
from riem_planner.mission.events import Event, Proposal
from riem_planner.mission.planning import Goal
from riem_planner.problem import Problem
from riem_planner.solution import Solution


class Ledger:
    """The events that are to be told, and the goal whose end has not been.

    Attributes
    ----------
    events
        To be published, in this order.
    unfinished
        The goal that has been taken and has had no end yet; None if there is none.
    """

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.unfinished: Goal | None = None
        self._told = ""

    def take(self) -> list[Event]:
        """What has happened since the last call."""
        events, self.events = self.events, []
        return events

    def fresh(self) -> None:
        """What is told next is news, whatever was told before."""
        self._told = ""

    def open(self, goal: Goal) -> None:
        """A goal has been taken; what was unfinished is replaced by it."""
        self.end(Code.REPLACED, "another goal came")
        self.unfinished = goal
        self.fresh()

    def end(
        self, code: Code, message: str, reason: str = "", times: tuple[int, int] | None = None
    ) -> None:
        """Tell the end of the unfinished goal, if there is one."""
        if self.unfinished is None:
            return
        goal, self.unfinished = self.unfinished, None
        start_ns, arrival_ns = times or (None, None)
        self.events.append(
            Event(
                code,
                message,
                goal=goal,
                reason=reason,
                start_ns=start_ns,
                arrival_ns=arrival_ns,
            )
        )
        self.fresh()

    def refuse(self, goal: Goal, why: str) -> None:
        """Tell that a goal was not taken."""
        message = f"goal refused: {why}"
        self.events.append(Event(Code.REFUSED, message, goal=goal, reason=why))

    def reject(self, topic: str, why: str, goal: Goal | None) -> None:
        """Tell that a message could not be used; it was a goal's, or not."""
        message = f"message on {topic} rejected: {why}; the last good data is kept"
        event = Event(Code.REFUSED, message, goal=goal, reason=why, topic=topic)
        self.events.append(event)

    def count_refusals(self, topic: str, count: int) -> None:
        """Tell of refusals that were too many to be told one by one."""
        message = f"{count} more refused on {topic}"
        self.events.append(Event(Code.REFUSED, message, reason=message, topic=topic))

    def pass_over(self, goal: Goal) -> None:
        """Tell the end of a goal that was sent before the one that is known, and came after it."""
        message = "a goal that was sent later is known already"
        self.events.append(Event(Code.REPLACED, message, goal=goal))

    def tell(
        self,
        code: Code,
        message: str,
        goal: Goal | None,
        *,
        level: Level | None = None,
        solution: Solution | None = None,
        problem: Problem | None = None,
        times: tuple[int, int] | None = None,
    ) -> None:
        """Leave an event, unless it is the very one that was told last."""
        if message == self._told:
            return
        self._told = message
        start_ns, arrival_ns = times or (None, None)
        self.events.append(
            Event(code, message, level, goal, start_ns, arrival_ns, "", solution, problem)
        )

    def tell_plan(self, code: Code, message: str, goal: Goal | None, proposal: Proposal) -> None:
        """Tell of a plan that is flown or shown."""
        solution, slew = proposal.solution, proposal.segments[0]
        self.fresh()
        self.events.append(
            Event(
                code,
                f"{message}: {slew.trajectory.duration:.6g} s, cost {solution.cost:.6g},"
                f" solved in {1e3 * solution.solve_time:.3g} ms",
                goal=goal,
                start_ns=slew.start_ns,
                arrival_ns=slew.end_ns,
                solution=solution,
                problem=proposal.problem,
                proposal=proposal,
            )
        )
