# SPDX-License-Identifier: Apache-2.0
"""What the node does about goals, changes of the world, and faults.

Everything here is a plain call with a time in integer nanoseconds. What is to be told is left
in the ledger, what is to be planned in `wanted`, what is to be streamed in the flight's timeline.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.mission import planning, recovery, requests, tracking
from riem_planner.mission.codes import Code, code_of
from riem_planner.mission.events import Event, Measurement, Proposal
from riem_planner.mission.flight import Flight
from riem_planner.mission.ledger import Ledger
from riem_planner.mission.phases import LIFE, Life, Order
from riem_planner.mission.planning import Goal, Reason, Request, Result
from riem_planner.mission.safety import Judge, Verdict
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Purpose, Reference, Segment, Setpoint, Timeline
from riem_planner.mission.zone_tracker import TurningBodies, World
from riem_planner.problem import Problem
from riem_planner.solution import Solution, Status

Array = NDArray[np.float64]

BACKWARD_NS = 50_000_000
"""The clock may be set back by that much without being said to have jumped [ns]."""
FORWARD_NS = 1_000_000_000
"""And forward [ns]."""
RETRY_NS = 1_000_000_000
"""Time between two attempts at a goal that could not be planned to [ns]."""
TRIES = 3
"""Plans in a row that the world may overtake before it is left alone for a while."""
PATIENCE = 16.0
"""The most that the planning budget is stretched by, for a solve that takes longer."""
CONTINUOUS = 1e-9
"""A jump of the rate at a splice that is rounding [rad/s]."""
INACTIVE = "inactive"
"""Why a goal is refused, and a request not carried out, while the node does not plan."""
NO_CLOCK = "use_sim_time: no time has come on /clock yet"
"""What is waited for where time is simulated and nobody tells it."""
_NOT_READY = "the plan was not ready in time"


class Mission:
    """The state of the planner, and what happens to it.

    Parameters
    ----------
    settings
        The parameters.
    keeps_goals
        Whether a goal that comes before the first activation is kept and flown then; by default
        where the node activates itself.

    Attributes
    ----------
    life
        Whether it plans and streams, or only comes to rest.
    world
        What is known of zones and obstacles.
    flight
        What is streamed.
    ledger
        What is told.
    goal
        Where to go; None if there is nowhere.
    """

    def __init__(self, settings: Settings, *, keeps_goals: bool | None = None) -> None:
        self.settings = settings
        starts = settings.autostart if keeps_goals is None else keeps_goals
        self.life = Life.NEW if starts else Life.INACTIVE
        self.world = World(settings)
        self.flight = Flight(self.world, settings)
        self.ledger = Ledger()
        self.goal: Goal | None = None
        self.shown: Proposal | None = None
        self.pending: Request | None = None
        self.wanted: Request | None = None
        self.measured: Measurement | None = None
        self._last_ns: int | None = None
        self._planned_version = 0
        self._retry_ns = self._gain_ns = 0
        self._patience = 1.0
        self._overtaken = 0
        self._silent = False  # no more is heard of the target that was followed

    @property
    def active(self) -> bool:
        """Whether it streams."""
        return self.life in (Life.ACTIVE, Life.ENDING)

    @property
    def reference(self) -> Reference:
        """What is streamed."""
        return self.flight.reference

    @property
    def timeline(self) -> Timeline:
        """What is streamed, now and later."""
        return self.flight.timeline

    @property
    def verdict(self) -> Verdict | None:
        """Of the timeline, when it was last judged."""
        return self.flight.verdict

    @property
    def leaving(self) -> bool:
        """Whether it is on the way out of a zone."""
        return self.flight.leaving

    # What comes in ---------------------------------------------------------------------------

    def activate(self, now_ns: int) -> None:
        """Begin to plan and to stream; where nothing is streamed yet, from the measured state."""
        self.advance(now_ns)
        self.life = LIFE[self.life, Order.ACTIVATE]
        self.ledger.fresh()
        if self.goal is not None:
            self._request(now_ns, Reason.GOAL)
        elif self.world.missing:
            self.ledger.tell(Code.WAITING, self._missing(), None)

    def end(self, now_ns: int, within: float | None = None) -> str:
        """Give up the goal and come to rest, to be deactivated then; says how.

        Parameters
        ----------
        now_ns
            The time [ns].
        within
            How long that is to take, if it can be had [s].
        """
        self.advance(now_ns)
        self.life = LIFE[self.life, Order.END]
        self._withdraw()
        message = self.flight.stop(now_ns, within) if self.timeline else "nothing was flown"
        self._give_up(f"cancelled, since the node ends its work: {message}")
        return message

    def wait_for_clock(self) -> None:
        """Tell that no time has come yet, where it is simulated."""
        self.ledger.tell(Code.WAITING, NO_CLOCK, self.goal)

    def deactivate(self) -> None:
        """Stream and plan no more; call it once the stream has come to rest."""
        self.life = LIFE[self.life, Order.DEACTIVATE]
        self._withdraw()
        self._give_up("cancelled: the node is deactivated")
        self.flight.end()

    def _give_up(self, message: str) -> None:
        self.ledger.end(Code.CANCELLED, message)
        self.goal, self.shown = None, None
        self.flight.turn_to_another()

    def configure(self, settings: Settings, now_ns: int) -> None:
        """Take new parameters, and judge what flies by them."""
        self.advance(now_ns)
        waited = self.world.missing
        self.settings = self.flight.settings = settings
        self.world.configure(settings)
        self._judge(now_ns)
        self._no_longer_waited_for(waited, now_ns)

    def set_goal(self, goal: Goal, now_ns: int, *, stamped: bool = True) -> bool:
        """Go there.

        Parameters
        ----------
        goal
            Where to go.
        now_ns
            The time [ns].
        stamped
            Whether the goal's stamp is that of its message: an equal goal without one is nothing.

        Returns
        -------
        bool
            Whether it is taken as another goal.
        """
        self.advance(now_ns)
        if self.goal is not None and tracking.corrects(goal, self.goal, now_ns):
            return self._correct(goal, now_ns)
        why = self._objection(goal, now_ns)
        if why:
            self.ledger.refuse(goal, f"{why}; what was wanted before stays")
            return False
        if self.goal is not None and goal.equals(self.goal):
            same = not stamped or goal.stamp_ns == self.goal.stamp_ns
            return not same and self._take_over(goal, now_ns)
        self.goal, self.shown, self._patience = goal, None, 1.0
        self.flight.stop_due = self._silent = False
        self.flight.turn_to_another()
        self.ledger.open(goal)
        self._request(now_ns, Reason.GOAL)
        return True

    def _correct(self, told: Goal, now_ns: int) -> bool:
        """The target moves otherwise than it was told to: the same goal, without an event."""
        assert self.goal is not None  # the caller looked
        why = self._past_limits(told)
        if why:
            self.ledger.refuse(told, why)
            return False
        if (told.since_ns or 0) < (self.goal.since_ns or 0):
            return False  # the newest wins
        self._rename(replace(told, stamp_ns=self.goal.stamp_ns))
        self._silent = False
        if not self.flight.bound:
            if self.pending is None and self.shown is None and self.life is Life.ACTIVE:
                self._request(now_ns, Reason.RETRY)
        elif not tracking.correct(self.flight, self.goal, now_ns) and not self.flight.arrived():
            self._request(now_ns, Reason.TARGET)
        return False

    def _rename(self, goal: Goal) -> None:
        """The same goal, told anew."""
        if self.ledger.unfinished is self.goal:
            self.ledger.unfinished = goal
        self.goal = goal

    def _past_limits(self, goal: Goal) -> str:
        limits = self.settings.limits
        used = {} if limits is None else limits.used(goal.rate, np.zeros(3))
        for key, part in used.items():
            if part > 1.0 + 1e-9:
                return f"its rate uses {part:.3g} times limits.{key}"
        return ""

    def _take_over(self, goal: Goal, now_ns: int) -> bool:
        """The same goal under another stamp: what is planned and flown is for it from now on."""
        self.goal = goal
        self.ledger.open(goal)
        if self.shown is not None:
            self.ledger.tell_plan(
                Code.SHOWN, "certified; call ~/execute to fly it", goal, self.shown
            )
        elif self.flight.arrived():
            self._arrive()
        elif self.flight.bound:
            self.ledger.tell(Code.FLYING, "what flies goes there", goal, times=self.flight.times)
        elif self.pending is None:
            self._request(now_ns, Reason.GOAL)
        return True

    def _objection(self, goal: Goal, now_ns: int) -> str:
        """Why a goal can't be taken at all; empty if it can."""
        if self.life in (Life.INACTIVE, Life.ENDING):
            return INACTIVE
        if not self.active or self.world.missing or not now_ns:
            return ""  # to be looked at when it can be planned to
        why = self._past_limits(goal)
        if why:
            return why
        ahead = self.settings.planning_budget + self.settings.duration
        arrival_ns = now_ns + round(1e9 * ahead)
        rest = np.zeros(3)
        here = Setpoint(now_ns, goal.at(arrival_ns), rest, rest)
        try:
            planning.build_problem(self.settings, self.world, here, goal, self.settings.duration)
        except InvalidProblemError as error:
            return str(error)
        inside = Judge(self.world, self.settings, now_ns).inside(here._replace(stamp_ns=arrival_ns))
        if inside:
            return f"it is inside {', '.join(inside)}; {Status.GOAL_IN_ZONE.advice}"
        return ""

    def see_direction(self, source: str, direction: Array, stamp_ns: int, now_ns: int) -> None:
        """Take in a direction (3,) of `zones/<name>` or `bodies/<name>`, and judge what flies."""
        self.advance(now_ns)
        waited = self.world.missing
        if self.world.update(source, direction, stamp_ns):
            self._judge(now_ns)
        self._no_longer_waited_for(waited, now_ns)

    def _no_longer_waited_for(self, waited: tuple[str, ...], now_ns: int) -> None:
        """Plan, if a direction has come that was waited for."""
        came = waited and not self.world.missing
        if came and self.goal is not None and self.life is Life.ACTIVE:
            self._request(now_ns, Reason.RETRY)

    def see_obstacles(self, quaternions: Array, stamp_ns: int, now_ns: int) -> None:
        """Take in the whole set of orientation obstacles (n, 4), and judge what flies by it."""
        self.advance(now_ns)
        if self.world.update_orientations(quaternions, stamp_ns):
            self._judge(now_ns)

    def see_turning(self, bodies: TurningBodies, now_ns: int) -> None:
        """Take in the whole set of attitudes that turn, and judge what flies by it."""
        self.advance(now_ns)
        self.world.update_turning(bodies)
        self._judge(now_ns)

    def see_state(self, quaternion: Array, rate: Array, stamp_ns: int, now_ns: int) -> None:
        """Take in the measured attitude (4,) and rate (3,) [rad/s]."""
        self.advance(now_ns)
        first = self.measured is None
        self.measured = Measurement(quaternion, rate, stamp_ns)
        if first and not self.timeline and self.goal is not None and self.pending is None:
            self._request(now_ns, Reason.RETRY)

    def replan(self, now_ns: int) -> tuple[bool, str]:
        """Plan to the goal anew."""
        self.advance(now_ns)
        if self.life is not Life.ACTIVE:
            return False, "the node is not active"
        if self.goal is None:
            return False, "there is no goal; send one to ~/goal"
        self.ledger.fresh()
        self._request(now_ns, Reason.REQUEST)
        return True, "planning; the outcome comes on ~/status"

    def cancel(self, now_ns: int) -> tuple[bool, str]:
        """Give up the goal, come to rest along a certified stop, and hold."""
        self.advance(now_ns)
        if self.life is not Life.ACTIVE:
            kept = self.goal is not None
            self._give_up("cancelled before it was planned to")
            return kept, "the goal that was kept is given up" if kept else "the node is not active"
        self._withdraw()
        if not self.timeline:
            self._give_up("cancelled; nothing was flown")
            return True, "cancelled; nothing was flown"
        message = "cancelled: " + self.flight.stop(now_ns)
        self._give_up(message)
        return True, message

    def execute(self, now_ns: int) -> tuple[bool, str]:
        """Fly the plan that is shown, if it is certified at this moment."""
        self.advance(now_ns)
        proposal = self.shown
        if self.life is not Life.ACTIVE:
            return False, "the node is not active"
        if proposal is None:
            return False, "no plan is shown"
        begin = now_ns + recovery.lead_ns(self.settings)
        fresh = proposal.fresh and not self.timeline
        if not fresh and not self._continuous(proposal.request.start, begin):
            self._request(now_ns, Reason.EXECUTE, approved=True)
            return True, "the reference has moved on: planned anew from it, then flown"
        verdict = self._fly(proposal, now_ns if fresh else begin, now_ns)
        if verdict is None:
            self._request(now_ns, Reason.EXECUTE, approved=True)
            return True, "it comes too late for the reference: planned anew, then flown"
        if verdict.certified:
            return True, "flying"
        self.shown = None
        self._request(now_ns, Reason.GOAL)
        return False, "no longer certified: " + "; ".join(verdict.reasons)

    def tick(self, now_ns: int) -> None:
        """Look after what changes with time: arrivals, zones that move, goals not reached yet."""
        self.advance(now_ns)
        if self.ledger.unfinished is not None and self.flight.arrived():
            self._arrive()
        if self.goal is not None and self.goal.moving and self.flight.parting():
            self.flight.part()
            self._silent = True
            timeout = self.settings.tracking_timeout
            message = f"nothing was heard of the target for {timeout:g} s: a certified stop"
            self.ledger.tell(Code.STOP, message, self.goal)
        if self.flight.stop_due:
            self.flight.stop(now_ns)
        elif self.timeline and self.flight.is_due(now_ns):
            self._judge(now_ns)
        waiting = self.goal is not None and not self.flight.bound and not self._silent
        if waiting and self.pending is None and self.shown is None and now_ns >= self._retry_ns:
            self._retry(now_ns)

    def _arrive(self) -> None:
        self.ledger.end(Code.ARRIVED, "arrived", times=self.flight.times)

    def advance(self, now_ns: int) -> None:
        """Note the time. A jump of the clock moves the whole timeline along with it."""
        last, self._last_ns = self._last_ns, now_ns
        if last is not None:
            # A decision that takes long is no jump: it was streamed on meanwhile.
            jump = now_ns - max(last, min(self.reference.streamed_ns, now_ns))
            if not -BACKWARD_NS <= jump <= FORWARD_NS:
                # The stream may have been ahead of the last call when the clock was set back.
                back = now_ns - max(last, self.reference.streamed_ns)
                self._jump(min(jump, back) if jump < 0 else jump, now_ns, known=last != 0)
        self.reference.prune(now_ns)

    def _jump(self, jump: int, now_ns: int, *, known: bool) -> None:
        """The clock was set, or has begun to be known."""
        self.flight.shift(jump)
        self.world.shift(jump, everything=known)
        if self.measured is not None and (known or self.measured.stamp_ns == 0):
            self.measured = self.measured._replace(stamp_ns=self.measured.stamp_ns + jump)
        if self.goal is not None and self.goal.moving and known:
            self._rename(self.goal.shifted(jump))
        self._retry_ns = self._gain_ns = now_ns
        if self.timeline:
            self.ledger.tell(
                Code.CLOCK_JUMP,
                f"the clock jumped by {jump * 1e-9:+.3f} s; the stream goes on from where it was",
                self.ledger.unfinished,
                times=self.flight.times if self.flight.bound else None,
            )
        if self.pending is not None:
            self._request(now_ns, self.pending.reason, approved=self.pending.approved)

    # What comes back from the worker ----------------------------------------------------------

    def accept(self, result: Result, now_ns: int) -> None:
        """Take in what became of the pending request; anything else is out of date."""
        self.advance(now_ns)
        request, solution = result.request, result.solution
        if request is not self.pending or self.life is not Life.ACTIVE:
            return
        self.pending = None
        if solution.trajectory is None:
            self._refused(result, now_ns)
            return
        start_ns = self._start(request, now_ns)
        if start_ns is None:
            self._stretch(now_ns, request, _NOT_READY)
            return
        if not self._continuous(request.start, start_ns):
            self._request(now_ns, request.reason, approved=request.approved)
            return
        proposal = self._proposal(result, start_ns, now_ns)
        if proposal is None:
            return
        if request.reason is Reason.GAIN and not self._gains(result):
            return
        if not (self.settings.auto_execute or request.approved or request.reason is Reason.GAIN):
            self.shown = proposal
            message = "certified; call ~/execute to fly it"
            self.ledger.tell_plan(Code.SHOWN, message, self.goal, proposal)
            return
        verdict = self._fly(proposal, start_ns, now_ns)
        if verdict is None:
            self._stretch(now_ns, request, _NOT_READY)
        elif not verdict.certified:
            # The world has changed since it was asked for; the newest counts.
            self._overtaken += 1
            why = "the world has changed since it was planned: " + "; ".join(verdict.reasons)
            if self._overtaken > TRIES:
                self._fail(why, now_ns)
                return
            self.ledger.tell(Code.OVERTAKEN, f"planned anew; {why}", self.goal)
            self._request(now_ns, request.reason, approved=request.approved)

    def _start(self, request: Request, now_ns: int) -> int | None:
        """When a plan may begin: where it was meant to, or later if nothing moves till then."""
        soon = now_ns + recovery.lead_ns(self.settings)
        if request.fresh and not self.timeline:
            moving = float(np.linalg.norm(request.start.rate)) > 0.0
            if not (moving or request.goal.moving):
                return now_ns
            return request.splice_ns if request.splice_ns >= now_ns else None
        if request.splice_ns >= now_ns:
            return request.splice_ns
        here = self.timeline.at(soon)
        resting = self.timeline.resting(min(soon, request.splice_ns))
        return soon if here is not None and resting else None

    def _continuous(self, start: Setpoint, start_ns: int) -> bool:
        """Whether a plan from a state continues what is streamed at a time."""
        before = self.timeline.at(start_ns)
        if before is None:
            return True
        turned = abs(abs(float(before.quaternion @ start.quaternion)) - 1.0)
        jump = float(np.max(np.abs(before.rate - start.rate)))
        return turned < 1e-15 and jump < CONTINUOUS

    def _gains(self, result: Result) -> bool:
        """Whether a plan is cheaper enough than what flies to go over to it."""
        flown = result.request.attempts[0].warm_start
        assert flown is not None  # a gain is only looked for while something flies
        price = planning.cost_along(result.problem, flown)
        return result.solution.cost < (1.0 - self.settings.replan_gain) * price

    def _look_for_gain(self, now_ns: int) -> None:
        """Where the world has changed since the plan, see if another way is cheaper."""
        slew = self.flight.slew
        flying = self.flight.bound and slew is not None and now_ns < slew.end_ns
        changed = self.world.version != self._planned_version
        if flying and changed and self.pending is None and now_ns - self._gain_ns >= RETRY_NS:
            self._gain_ns, self._planned_version = now_ns, self.world.version
            self._request(now_ns, Reason.GAIN)

    def _proposal(self, result: Result, start_ns: int, now_ns: int) -> Proposal | None:
        trajectory = result.solution.trajectory
        assert trajectory is not None  # the caller looked
        slew = Segment(start_ns, trajectory, Purpose.SLEW)
        segments: tuple[Segment, ...] = (slew,)
        goal = result.request.goal
        if goal.moving:
            judge = Judge(self.world, self.settings, now_ns)
            until_ns = tracking.silent_from(goal, slew.end_ns, self.settings)
            start = tracking.arrived(slew)
            found = tracking.pursued(Timeline((slew,)), start, until_ns, judge, self.settings)
            if found is None:
                self._fail("no certified stop is left after the goal's rate is reached", now_ns)
                return None
            segments = found.timeline.segments
        return Proposal(
            segments, result.request, result.solution, result.problem, not self.timeline
        )

    def _fly(self, proposal: Proposal, start_ns: int, now_ns: int) -> Verdict | None:
        """Put a plan in the timeline, if the timeline is certified with it; None if too late."""
        shift = start_ns - proposal.segments[0].start_ns
        segments = tuple(
            replace(segment, start_ns=segment.start_ns + shift) for segment in proposal.segments
        )
        verdict = self.flight.fly(segments, now_ns)
        if verdict is not None and verdict.certified:
            self._overtaken, self._patience, self.shown = 0, 1.0, None
            self._planned_version = self.world.version
            flown = replace(proposal, segments=self.timeline.segments[-len(segments) :])
            self.ledger.tell_plan(Code.FLYING, "certified", self.goal, flown)
            if self.goal is not None and self.goal.moving:
                tracking.correct(self.flight, self.goal, now_ns)  # what came while it was planned
        return verdict

    def _refused(self, result: Result, now_ns: int) -> None:
        request, solution = result.request, result.solution
        if request.reason is Reason.GAIN or solution.status is Status.CANCELLED:
            return
        if solution.status is Status.OUT_OF_TIME and self._patience < PATIENCE:
            self._stretch(now_ns, request, solution.message)
            return
        self._fail(solution.message, now_ns, solution, result.problem)

    def _fail(
        self,
        why: str,
        now_ns: int,
        solution: Solution | None = None,
        problem: Problem | None = None,
    ) -> None:
        self._retry_ns = now_ns + RETRY_NS
        kept = "nothing is flown" if not self.timeline else f"{self.doing(now_ns)} goes on"
        code = Code.INVALID if solution is None else code_of(solution.status)
        if solution is not None and solution.status.advice not in why:
            why += f"; {solution.status.advice}"
        message = f"{why}; {kept}"
        self.ledger.tell(code, message, self.goal, solution=solution, problem=problem)

    def _stretch(self, now_ns: int, request: Request, why: str) -> None:
        """Plan from a later point, with more time."""
        if self._patience >= PATIENCE:
            self._fail(f"{why}, at {PATIENCE:g} planning budgets; raise planning_budget", now_ns)
            return
        self._patience *= 2.0
        ahead = f"it is planned from {self._patience:g} budgets ahead"
        self.ledger.tell(Code.LATE, f"{why}; what flies goes on, and {ahead}", self.goal)
        self._request(now_ns, request.reason, approved=request.approved)

    # Asking for plans ---------------------------------------------------------------------------

    def _missing(self) -> str:
        return f"no direction is known of zone {', '.join(self.world.missing)} yet"

    def _waits_for(self) -> str:
        """What has to come before it can be planned; empty if nothing."""
        if not self.active:
            return "kept until the node is active"
        if not self._last_ns:
            return NO_CLOCK
        if self.world.missing:
            return self._missing()
        if not self.timeline and self.settings.require_state and self.measured is None:
            return "require_state: nothing on ~/state or ~/imu yet"
        return ""

    def _request(self, now_ns: int, reason: Reason, *, approved: bool = False) -> None:
        """Ask for a plan to the goal; the newest request counts."""
        self._withdraw()
        goal = self.goal
        if goal is None or self.life is Life.ENDING:
            return
        self._retry_ns = now_ns + RETRY_NS
        waits = self._waits_for()
        if waits:
            self.ledger.tell(Code.WAITING, waits, goal)
            return
        why = self._objection(goal, now_ns) if self.flight.slew is None else ""
        if why and self.ledger.unfinished is goal:
            self.goal = None
            self.ledger.end(Code.REFUSED, f"goal refused: {why}", why)
            return
        ahead = round(self.settings.budget_ns * self._patience)
        fresh = not self.timeline
        if fresh:
            start = requests.measured_state(self.measured, self.settings, now_ns + ahead)
        else:
            leaving = Judge(self.world, self.settings, now_ns) if self.leaving else None
            start = requests.reference_state(self.timeline, self.settings, now_ns + ahead, leaving)
        try:
            attempts = requests.attempts(
                self.settings, self.world, start, goal, reason, self.flight.slew
            )
        except InvalidProblemError as error:
            self._fail(str(error), now_ns)
            return
        if not attempts:
            return
        deadline = ahead * 1e-9 * 0.9
        if fresh:
            deadline = max(deadline, 1.0)  # nothing is late before the stream begins
        self.wanted = self.pending = Request(
            reason, goal, attempts, deadline, start.stamp_ns, start, fresh, approved
        )

    def _retry(self, now_ns: int) -> None:
        """Try again what could not be planned, if the goal is not plainly forbidden."""
        self._retry_ns = now_ns + RETRY_NS
        assert self.goal is not None  # the caller looked
        if not self.world.missing and self._last_ns and self.flight.slew is not None:
            judge = Judge(self.world, self.settings, now_ns)
            end = Setpoint(now_ns, self.goal.at(now_ns), np.zeros(3), np.zeros(3))
            if judge.inside(end):
                return
        self._request(now_ns, Reason.RETRY)

    def _withdraw(self) -> None:
        self.pending = self.wanted = None

    # Judging what flies -------------------------------------------------------------------------

    def _judge(self, now_ns: int) -> None:
        """Certify the timeline from now on; where that fails, fly what is safe, and replan."""
        found = self.flight.check(now_ns)
        if found is None:
            verdict = self.verdict
            if (
                self.timeline
                and not self.world.missing
                and not self.leaving
                and verdict is not None
            ):
                self._look_for_gain(now_ns)
            return
        if found.reason is not None:
            self.shown = None
        self.ledger.tell(found.code, found.message, self.goal, level=found.level)
        if self.goal is not None and found.reason is not None:
            self._request(now_ns, found.reason)

    # Telling ------------------------------------------------------------------------------------

    def doing(self, now_ns: int) -> str:
        """What is being streamed, in a word."""
        if not self.active:
            return "inactive"
        if not self.timeline:
            return "idle"
        segment = self.timeline.segment_at(now_ns)
        if segment is None or now_ns >= segment.end_ns:
            return "holding"
        return segment.purpose.value

    def take_events(self) -> list[Event]:
        """What has happened since the last call."""
        return self.ledger.take()

    def take_wanted(self) -> Request | None:
        """What is to be planned, once."""
        request, self.wanted = self.wanted, None
        return request
