"""What the node does about goals, changes of the world, and faults.

Everything here is a plain call with a time in integer nanoseconds. What is to be told is left
in `events`, what is to be planned in `wanted`, what is to be streamed in `timeline`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.mission import planning, recovery, requests
from riem_planner.mission.events import Event, Level, Measurement, Proposal
from riem_planner.mission.planning import Goal, Reason, Request, Result
from riem_planner.mission.safety import Judge, Verdict
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Purpose, Reference, Segment, Setpoint, Timeline
from riem_planner.mission.zone_tracker import World
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
AHEAD_NS = (0, 50_000_000, 200_000_000, 800_000_000)
"""How much later what is safe may begin, on a machine that is too busy to find it at once [ns]."""
_TOO_BUSY = "the machine is too busy to change what flies; tried again"
_NOT_READY = "the plan was not ready in time"


@dataclass
class Mission:
    """The state of the planner, and what happens to it.

    Parameters
    ----------
    settings
        The parameters.

    Attributes
    ----------
    world
        What is known of zones and obstacles.
    reference
        What is streamed.
    goal
        Where to go; None if there is nowhere.
    verdict
        Of the timeline, when it was last judged.
    """

    settings: Settings
    active: bool = False
    reference: Reference = field(default_factory=Reference)
    goal: Goal | None = None
    shown: Proposal | None = None
    pending: Request | None = None
    wanted: Request | None = None
    measured: Measurement | None = None
    verdict: Verdict | None = None
    leaving: bool = False
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begin with an empty world."""
        self.world = World(self.settings)
        self._last_ns: int | None = None
        self._bound_for: Goal | None = None
        self._slew: Segment | None = None
        self._aim: Goal | None = None
        self._planned_version = 0
        self._retry_ns = 0
        self._gain_ns = 0
        self._patience = 1.0
        self._overtaken = 0
        self._told = ""
        self._judged = (-1, 0)
        self._rescue_due = self._stop_due = False

    @property
    def timeline(self) -> Timeline:
        """What is streamed, now and later."""
        return self.reference.timeline

    # What comes in ---------------------------------------------------------------------------

    def activate(self, now_ns: int) -> None:
        """Begin to plan and to stream; where nothing is streamed yet, from the measured state."""
        self.advance(now_ns)
        self.active = True

    def deactivate(self) -> None:
        """Forget goal and timeline; call it once the stream has come to rest."""
        self.active = False
        self._withdraw()
        self._forget_goal()
        self.reference.end()
        self.verdict, self.leaving, self._rescue_due, self._stop_due = None, False, False, False

    def _forget_goal(self) -> None:
        self.goal, self.shown, self._bound_for, self._slew, self._aim = (None,) * 5

    def configure(self, settings: Settings, now_ns: int) -> None:
        """Take new parameters, and judge what flies by them."""
        self.advance(now_ns)
        self.settings = settings
        self.world.configure(settings)
        self._judge(now_ns)

    def set_goal(self, goal: Goal, now_ns: int) -> bool:
        """Go there; False if it is the goal already, or if the node is not active."""
        self.advance(now_ns)
        if not self.active:
            self._tell(Level.WARN, "INACTIVE", "goal ignored: activate the node first")
            return False
        if goal.equals(self.goal):
            return False
        self.goal, self.shown, self._patience, self._told = goal, None, 1.0, ""
        self._stop_due = False
        self._request(now_ns, Reason.GOAL)
        return True

    def see_zone(self, name: str, direction: Array, stamp_ns: int, now_ns: int) -> None:
        """Take in where a zone is (3,), and judge what flies by it."""
        self.advance(now_ns)
        if self.world.update_zone(name, direction, stamp_ns):
            self._judge(now_ns)

    def see_obstacles(self, quaternions: Array, now_ns: int) -> None:
        """Take in the whole set of orientation obstacles (n, 4), and judge what flies by it."""
        self.advance(now_ns)
        if self.world.update_orientations(quaternions):
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
        if not self.active:
            return False, "the node is not active"
        if self.goal is None:
            return False, "there is no goal; send one to ~/goal"
        self._told = ""
        self._request(now_ns, Reason.REQUEST)
        return True, "planning; the outcome comes on ~/status"

    def cancel(self, now_ns: int) -> tuple[bool, str]:
        """Give up the goal, come to rest along a certified stop, and hold."""
        self.advance(now_ns)
        self._withdraw()
        self._forget_goal()
        if not self.timeline:
            return True, "cancelled; nothing was flown"
        message = "cancelled: " + self._stop(now_ns)
        self._tell(Level.OK, "CANCELLED", message)
        return True, message

    def execute(self, now_ns: int) -> tuple[bool, str]:
        """Fly the plan that is shown, if it is certified at this moment."""
        self.advance(now_ns)
        proposal = self.shown
        if not self.active or proposal is None:
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
        """Look after what changes with time: zones that move and grow, goals not reached yet."""
        self.advance(now_ns)
        again = self._rescue_due or (self.world.moving and now_ns - self._judged[1] >= 100_000_000)
        if self._stop_due:
            self._stop(now_ns)
        elif self.timeline and again:
            self._judge(now_ns)
        waiting = self.goal is not None and self._bound_for is not self.goal
        if waiting and self.pending is None and self.shown is None and now_ns >= self._retry_ns:
            self._retry(now_ns)

    def advance(self, now_ns: int) -> None:
        """Note the time. A jump of the clock moves the whole timeline along with it."""
        last, self._last_ns = self._last_ns, now_ns
        if last is not None:
            # A decision that takes long is no jump: it was streamed on meanwhile.
            jump = now_ns - max(last, min(self.reference.streamed_ns, now_ns))
            if not -BACKWARD_NS <= jump <= FORWARD_NS:
                self._jump(jump, now_ns)
        self.reference.prune(now_ns)

    def _jump(self, jump: int, now_ns: int) -> None:
        self.reference.shift(jump)
        self.world.shift(jump)
        if self._slew is not None:
            self._slew = replace(self._slew, start_ns=self._slew.start_ns + jump)
        if self.measured is not None:
            self.measured = self.measured._replace(stamp_ns=self.measured.stamp_ns + jump)
        self._retry_ns = self._gain_ns = now_ns
        if self.timeline:
            self._tell(
                Level.WARN,
                "CLOCK_JUMP",
                f"the clock jumped by {jump * 1e-9:+.3f} s; the stream goes on from where it was",
            )
        if self.pending is not None:
            self._request(now_ns, self.pending.reason, approved=self.pending.approved)

    # What comes back from the worker ----------------------------------------------------------

    def accept(self, result: Result, now_ns: int) -> None:
        """Take in what became of the pending request; anything else is out of date."""
        self.advance(now_ns)
        request, solution = result.request, result.solution
        if request is not self.pending or not self.active:
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
            self._told = ""
            self._tell_plan("SHOWN", "certified; call ~/execute to fly it", proposal)
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
            self._tell(Level.WARN, "OVERTAKEN", f"planned anew; {why}")
            self._request(now_ns, request.reason, approved=request.approved)

    def _start(self, request: Request, now_ns: int) -> int | None:
        """When a plan may begin: where it was meant to, or later if nothing moves till then."""
        soon = now_ns + recovery.lead_ns(self.settings)
        if request.fresh and not self.timeline:
            moving = float(np.linalg.norm(request.start.rate)) > 0.0
            if not moving:
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
        flying = self._bound_for is not None and now_ns < self.timeline.end_ns
        changed = self.world.version != self._planned_version
        if flying and changed and self.pending is None and now_ns - self._gain_ns >= RETRY_NS:
            self._gain_ns, self._planned_version = now_ns, self.world.version
            self._request(now_ns, Reason.GAIN)

    def _proposal(self, result: Result, start_ns: int, now_ns: int) -> Proposal | None:
        trajectory = result.solution.trajectory
        assert trajectory is not None  # the caller looked
        slew = Segment(start_ns, trajectory, Purpose.SLEW)
        segments: tuple[Segment, ...] = (slew,)
        if not result.request.goal.resting:
            judge = Judge(self.world, self.settings, now_ns)
            stop = recovery.come_to_rest(Timeline((slew,)), judge, self.settings, slew.end_ns - 1)
            if stop is None:
                self._fail("no certified stop is left after the goal's rate is reached", now_ns)
                return None
            segments = (slew, stop.timeline.last)
        return Proposal(
            segments, result.request, result.solution, result.problem, not self.timeline
        )

    def _fly(self, proposal: Proposal, start_ns: int, now_ns: int) -> Verdict | None:
        """Put a plan in the timeline, if the timeline is certified with it; None if too late."""
        shift = start_ns - proposal.segments[0].start_ns
        timeline = self.timeline
        for segment in proposal.segments:
            timeline = timeline.spliced(replace(segment, start_ns=segment.start_ns + shift))
        # A way out is no part of what can be certified; the plan that follows it is.
        judged = timeline
        if self.leaving:
            judged = Timeline(timeline.segments[-len(proposal.segments) :])
        verdict = Judge(self.world, self.settings, now_ns).timeline(judged)
        if verdict.certified:
            if not self.reference.change(timeline, start_ns):
                return None
            self._overtaken = 0
            self.verdict, self.shown = verdict, None
            self._bound_for, self._patience = proposal.request.goal, 1.0
            self._aim, self._slew = self._bound_for, timeline.segments[-len(proposal.segments)]
            self._planned_version = self.world.version
            self._judged = (self.world.version, now_ns)
            segments = timeline.segments[-len(proposal.segments) :]
            flown = replace(proposal, segments=segments)
            self._told = ""
            self._tell_plan("FLYING", "certified", flown)
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
        code = "INVALID" if solution is None else solution.status.name
        if solution is not None and solution.status.advice not in why:
            why += f"; {solution.status.advice}"
        self._tell(Level.ERROR, code, f"{why}; {kept}", solution, problem)

    def _stretch(self, now_ns: int, request: Request, why: str) -> None:
        """Plan from a later point, with more time."""
        if self._patience >= PATIENCE:
            self._fail(f"{why}, at {PATIENCE:g} planning budgets; raise planning_budget", now_ns)
            return
        self._patience *= 2.0
        self._tell(
            Level.WARN,
            "LATE",
            f"{why}; what flies goes on, and it is planned from {self._patience:g} budgets ahead",
        )
        self._request(now_ns, request.reason, approved=request.approved)

    # Asking for plans ---------------------------------------------------------------------------

    def _request(self, now_ns: int, reason: Reason, *, approved: bool = False) -> None:
        """Ask for a plan to the goal; the newest request counts."""
        self._withdraw()
        goal = self.goal
        if goal is None or not self.active:
            return
        self._retry_ns = now_ns + RETRY_NS
        if self.world.missing:
            names = ", ".join(self.world.missing)
            self._tell(Level.WARN, "WAITING", f"no direction is known of zone {names} yet")
            return
        if not self.timeline and self.settings.require_state and self.measured is None:
            self._tell(Level.WARN, "WAITING", "require_state: nothing on ~/state or ~/imu yet")
            return
        ahead = round(self.settings.budget_ns * self._patience)
        fresh = not self.timeline
        if fresh:
            start = requests.measured_state(self.measured, self.settings, now_ns + ahead)
        else:
            leaving = Judge(self.world, self.settings, now_ns) if self.leaving else None
            start = requests.reference_state(self.timeline, self.settings, now_ns + ahead, leaving)
        flying = self._slew if goal is self._aim else None
        try:
            attempts = requests.attempts(self.settings, self.world, start, goal, reason, flying)
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
        if not self.world.missing:
            judge = Judge(self.world, self.settings, now_ns)
            end = Setpoint(now_ns, self.goal.quaternion, np.zeros(3), np.zeros(3))
            if judge.inside(end):
                return
        self._request(now_ns, Reason.RETRY)

    def _withdraw(self) -> None:
        self.pending = self.wanted = None

    # Judging what flies -------------------------------------------------------------------------

    def _judge(self, now_ns: int) -> None:
        """Certify the timeline from now on; where that fails, fly what is safe, and replan."""
        self._judged, self._rescue_due = (self.world.version, now_ns), False
        if not self.timeline or self.world.missing:
            return
        judge = Judge(self.world, self.settings, now_ns)
        if self.leaving and self._still_leaving(judge, now_ns):
            return
        self.verdict = judge.timeline(self.timeline)
        if self.verdict.certified:
            self._look_for_gain(now_ns)
            return
        why = "; ".join(self.verdict.reasons)
        if self._dropped(now_ns):
            self._tell(Level.WARN, "OVERTAKEN", f"planned anew: {why}")
            self._request(now_ns, Reason.RETRY)
            return
        found = self._rescue(now_ns)
        if found is None:
            self._tell(Level.ERROR, "LATE", f"{_TOO_BUSY} ({why})")
            return
        level = Level.WARN if found.certified else Level.ERROR
        self._tell(level, found.purpose.name, f"{found.message} ({why})")
        if self.goal is not None:
            self._request(now_ns, Reason.OBSTACLE)

    def _still_leaving(self, judge: Judge, now_ns: int) -> bool:
        """Whether the way out is still one, and what follows it is certified."""
        segment = self.timeline.segment_at(now_ns)
        way = next((s for s in self.timeline.segments if s.purpose is Purpose.WAY_OUT), None)
        if way is None or (segment is way and now_ns >= way.end_ns):
            self.leaving = False
            return False
        after = Timeline(tuple(s for s in self.timeline.segments if s.start_ns > way.start_ns))
        until = after.segments[0].start_ns if after else way.end_ns
        if not judge.leaves(way, until):
            return False
        if not after:
            return True
        self.verdict = judge.timeline(after)
        return self.verdict.certified

    def _dropped(self, now_ns: int) -> bool:
        """Fly nothing, if nothing has begun that would have to be brought to rest."""
        begin_ns = self.timeline.segments[0].start_ns
        unbegun = now_ns + recovery.lead_ns(self.settings) < begin_ns
        if not unbegun or not self.reference.change(Timeline(), begin_ns - 1):
            return False
        self._bound_for = None
        return True

    def _rescue(self, now_ns: int) -> recovery.Rescue | None:
        """Fly what is safe; None if it was found too late each time, to be tried again."""
        for ahead_ns in AHEAD_NS:
            from_ns = max(now_ns, self.reference.streamed_ns)
            judge = Judge(self.world, self.settings, from_ns + ahead_ns)
            found = recovery.rescue(self.timeline, judge, self.settings)
            if not self._take(found):
                continue
            if ahead_ns:  # what flies till then counts as well
                self.verdict = Judge(self.world, self.settings, from_ns).timeline(self.timeline)
                if not self.verdict.certified:
                    message = f"{found.message}, but what flies before it is not certified"
                    return replace(found, certified=False, message=message)
            return found
        self._rescue_due = True
        return None

    def _take(self, found: recovery.Rescue) -> bool:
        if not self.reference.change(found.timeline, found.timeline.last.start_ns):
            return False
        self.shown, self._bound_for = None, None
        self.leaving = found.purpose is Purpose.WAY_OUT and not found.certified
        self.verdict = found.verdict
        return True

    def _stop(self, now_ns: int) -> str:
        """Come to rest; says how."""
        self._stop_due = False
        begin = now_ns + recovery.lead_ns(self.settings)
        if self.timeline.resting(begin):
            return "held at rest"
        if self._dropped(now_ns):
            return "nothing had begun"
        if self.leaving:
            return "the way out of a zone is flown to its end, then held"
        judge = Judge(self.world, self.settings, now_ns)
        found = recovery.come_to_rest(self.timeline, judge, self.settings, begin)
        if found is None or not self._take(found):
            found = self._rescue(now_ns)
        self._stop_due = found is None
        return _TOO_BUSY if found is None else found.message

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
        events, self.events = self.events, []
        return events

    def take_wanted(self) -> Request | None:
        """What is to be planned, once."""
        request, self.wanted = self.wanted, None
        return request

    def _tell(
        self,
        level: Level,
        code: str,
        message: str,
        solution: Solution | None = None,
        problem: Problem | None = None,
    ) -> None:
        """Leave an event, unless it is the very one that was told last."""
        if message == self._told:
            return
        self._told = message
        self.events.append(Event(level, code, message, solution, problem))

    def _tell_plan(self, code: str, message: str, proposal: Proposal) -> None:
        solution = proposal.solution
        seconds = proposal.segments[0].trajectory.duration
        self.events.append(
            Event(
                Level.OK,
                code,
                f"{message}: {seconds:.6g} s, cost {solution.cost:.6g},"
                f" solved in {1e3 * solution.solve_time:.3g} ms",
                solution,
                proposal.problem,
                proposal,
            )
        )
