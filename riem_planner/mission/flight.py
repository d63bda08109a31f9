# SPDX-License-Identifier: Apache-2.0
"""What is flown: the timeline, its verdict, and what takes its place where it may not be flown."""

from __future__ import annotations

from dataclasses import dataclass, replace

from riem_planner.mission import recovery
from riem_planner.mission.codes import Code, Level
from riem_planner.mission.phases import COURSE, Happening, Phase
from riem_planner.mission.planning import Reason
from riem_planner.mission.safety import Judge, Verdict
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Purpose, Reference, Segment, Timeline
from riem_planner.mission.zone_tracker import World

AHEAD_NS = (0, 50_000_000, 200_000_000, 800_000_000)
"""How much later what is safe may begin, on a machine that is too busy to find it at once [ns]."""
TOO_BUSY = "the machine is too busy to change what flies; tried again"


@dataclass(frozen=True)
class Change:
    """What had to be done about the timeline, to be told, and planned anew for that reason."""

    code: Code
    message: str
    reason: Reason | None
    level: Level | None = None


class Flight:
    """The timeline, and whether it may be flown.

    Parameters
    ----------
    world, settings
        What is forbidden.

    Attributes
    ----------
    reference
        What is streamed.
    verdict
        Of the timeline, when it was last judged.
    phase
        What is flown, and whether it goes to the goal.
    slew
        The slew to the present goal that was flown last; None if none has been.
    times
        When the slew begins and arrives, as it was told [ns].
    rescue_due, stop_due
        What was found too late, and is to be tried again.
    """

    def __init__(self, world: World, settings: Settings) -> None:
        self.world, self.settings = world, settings
        self.reference = Reference()
        self.verdict: Verdict | None = None
        self.phase = Phase.IDLE
        self.rescue_due = self.stop_due = False
        self.slew: Segment | None = None
        self.times: tuple[int, int] | None = None
        self._judged = (-1, 0)

    @property
    def timeline(self) -> Timeline:
        """What is streamed, now and later."""
        return self.reference.timeline

    @property
    def bound(self) -> bool:
        """Whether what is flown goes to the goal."""
        return self.phase in (Phase.BOUND, Phase.RETURNING)

    @property
    def leaving(self) -> bool:
        """Whether it is on the way out of a zone."""
        return self.phase in (Phase.LEAVING, Phase.RETURNING)

    def _now(self, happening: Happening) -> None:
        self.phase = COURSE[self.phase, happening]

    def end(self) -> None:
        """Stream nothing any more."""
        self.reference.end()
        self.verdict = None
        self.rescue_due = self.stop_due = False
        self._now(Happening.DROP)
        self.turn_to_another()

    def turn_to_another(self) -> None:
        """What is flown does not go to the goal that counts from now on."""
        self.slew, self.times = None, None
        self._now(Happening.TURN)

    def part(self) -> None:
        """The target that was followed has fallen silent."""
        self._now(Happening.PART)

    def shift(self, nanoseconds: int) -> None:
        """The clock has jumped by that much."""
        self.reference.shift(nanoseconds)
        if self.slew is not None:
            self.slew = replace(self.slew, start_ns=self.slew.start_ns + nanoseconds)
        if self.times is not None:
            self.times = self.times[0] + nanoseconds, self.times[1] + nanoseconds

    def is_due(self, now_ns: int) -> bool:
        """Whether it is time to judge the timeline again."""
        since = now_ns - self._judged[1]
        return self.rescue_due or (self.world.moving and since >= 100_000_000)

    def arrived(self) -> bool:
        """Whether the setpoint of the slew's arrival has been streamed."""
        slew = self.slew if self.bound else None
        return slew is not None and self.reference.streamed_ns >= slew.end_ns

    def parting(self) -> bool:
        """Whether the stop after a target that was followed has begun to be streamed."""
        last = self.timeline.last if self.bound and self.timeline else None
        stops = last is not None and last.purpose is Purpose.STOP
        return stops and last is not None and self.reference.streamed_ns >= last.start_ns

    def fly(self, segments: tuple[Segment, ...], now_ns: int) -> Verdict | None:
        """Put segments in the timeline, if it is certified with them; None if too late."""
        timeline = self.timeline
        for segment in segments:
            timeline = timeline.spliced(segment)
        # A way out is no part of what can be certified; the plan that follows it is.
        flown = timeline.segments[-len(segments) :]
        judged = Timeline(flown) if self.leaving else timeline
        verdict = Judge(self.world, self.settings, now_ns).timeline(judged)
        if verdict.certified:
            if not self.reference.change(timeline, segments[0].start_ns):
                return None
            self.verdict, self.slew = verdict, flown[0]
            self._now(Happening.FLY)
            self.times = flown[0].start_ns, flown[0].end_ns
            self._judged = (self.world.version, now_ns)
        return verdict

    def go_over(self, found: recovery.Rescue, from_ns: int, slew: Segment | None = None) -> bool:
        """Take a certified timeline that differs from a time [ns] on; False if that is too late.

        Where it has another slew to the goal, that one counts from now on.
        """
        if not self.reference.change(found.timeline, from_ns):
            return False
        self.verdict, self.slew = found.verdict, slew or self.slew
        return True

    def check(self, now_ns: int) -> Change | None:
        """Certify the timeline from now on; where that fails, fly what is safe."""
        self._judged, self.rescue_due = (self.world.version, now_ns), False
        if not self.timeline or self.world.missing:
            return None
        judge = Judge(self.world, self.settings, now_ns)
        if self.leaving and self._still_leaving(judge, now_ns):
            return None
        self.verdict = judge.timeline(self.timeline)
        if self.verdict.certified:
            return None
        why = "; ".join(self.verdict.reasons)
        if self.drop(now_ns):
            return Change(Code.OVERTAKEN, f"planned anew: {why}", Reason.RETRY)
        found = self.rescue(now_ns)
        if found is None:
            return Change(Code.LATE, f"{TOO_BUSY} ({why})", None, Level.ERROR)
        code = found.code
        level = None if found.certified else Level.ERROR
        return Change(code, f"{found.message} ({why})", Reason.OBSTACLE, level)

    def _still_leaving(self, judge: Judge, now_ns: int) -> bool:
        """Whether the way out is still one, and what follows it is certified."""
        segment = self.timeline.segment_at(now_ns)
        way = next((s for s in self.timeline.segments if s.purpose is Purpose.WAY_OUT), None)
        if way is None or (segment is way and now_ns >= way.end_ns):
            self._now(Happening.CLEAR)
            return False
        after = Timeline(tuple(s for s in self.timeline.segments if s.start_ns > way.start_ns))
        until = after.segments[0].start_ns if after else way.end_ns
        if not judge.leaves(way, until):
            return False
        if not after:
            return True
        self.verdict = judge.timeline(after)
        return self.verdict.certified

    def drop(self, now_ns: int) -> bool:
        """Fly nothing, if nothing has begun that would have to be brought to rest."""
        begin_ns = self.timeline.segments[0].start_ns
        unbegun = now_ns + recovery.lead_ns(self.settings) < begin_ns
        if not unbegun or not self.reference.change(Timeline(), begin_ns - 1):
            return False
        self._now(Happening.DROP)
        return True

    def rescue(self, now_ns: int) -> recovery.Rescue | None:
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
        self.rescue_due = True
        return None

    def _take(self, found: recovery.Rescue) -> bool:
        if not self.reference.change(found.timeline, found.timeline.last.start_ns):
            return False
        out = found.purpose is Purpose.WAY_OUT and not found.certified
        self._now(Happening.WAY_OUT if out else Happening.RESCUE)
        self.verdict = found.verdict
        return True

    def stop(self, now_ns: int, within: float | None = None) -> str:
        """Come to rest; says how.

        Parameters
        ----------
        now_ns
            The time [ns].
        within
            The stop is to take no longer, if one can be certified that does not [s].
        """
        self.stop_due = False
        begin = now_ns + recovery.lead_ns(self.settings)
        if self.timeline.resting(begin):
            return "held at rest"
        if self.drop(now_ns):
            return "nothing had begun"
        if self.leaving:
            return "the way out of a zone is flown to its end, then held"
        judge = Judge(self.world, self.settings, now_ns)
        found = recovery.come_to_rest(self.timeline, judge, self.settings, begin, within)
        if found is None or not self._take(found):
            found = self.rescue(now_ns)
        self.stop_due = found is None
        return TOO_BUSY if found is None else found.message
