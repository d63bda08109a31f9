# SPDX-License-Identifier: Apache-2.0
"""What the planner promises of its stream, as sentences M1 to M8, each judged on its own.

Scope, condition, component, timing and response stand in the sentences as in the language FRET.
Nothing here is shared with what it judges, and nothing but messages is known to it.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from riem_planner.monitor.curve import (
    Quaternion,
    State,
    Vector,
    about,
    angle_between,
    between,
    combined,
    cross,
    dot,
    norm,
    turn_between,
    turned,
)

SENTENCES = {
    "M1": "The planner shall always satisfy: a setpoint's quaternion is unit to 1e-6, and its dot"
    " product with the one before is positive.",
    "M2": "The planner shall always satisfy: stamps increase, by at most 2 / setpoint_rate while"
    " it streams.",
    "M3": "The planner shall always satisfy: from one setpoint to the next the turn is at most the"
    " greatest rate between them times the interval, and 1e-6 rad.",
    "M4": "The planner shall always satisfy: the boresight of every zone is outside it, unless"
    " ~/status says WAY_OUT.",
    "M5": "The planner shall always satisfy: rate, acceleration, torque and momentum are within"
    " the limits, 1e-6 relative.",
    "M6": "The planner shall always satisfy: setpoints lie on the last ~/reference, to 1e-6 rad.",
    "M7": "When a goal is cancelled, the planner shall within the announced stop satisfy: the rate"
    " is 0.",
    "M8": "When an input is older than its timeout, the planner shall within 1 s satisfy: it"
    " warns.",
}

UNIT = ON_REFERENCE = TURN = LIMIT = 1e-6
AT_REST = 1e-9
"""Rate that counts as 0 [rad/s]."""
GRACE_NS = 500_000_000
"""Time that the planner has to answer a zone that came over what flies [ns]."""
WARN_WITHIN_NS = 1_000_000_000
_SECOND = 1e-9
_MOST_REFERENCES = 8
_STOP = re.compile(r"stop within ([0-9.]+) s")
_EXCUSED = ("CLOCK_JUMP", "CANCELLED")


@dataclass(frozen=True)
class Zone:
    """A zone as parameters state it.

    Parameters
    ----------
    name, group, member
        Of a group one member is kept whole; a zone without a group is its own.
    keep_in
        Whether its boresight is to be inside.
    boresight, direction
        Body axis; and where the centre is in the reference frame until a message comes.
    half_angle
        [rad]
    rate
        Of the centre, in the reference frame [rad/s].
    timeout
        Age of its messages past which the planner has to warn; 0: never [s].
    """

    name: str
    keep_in: bool
    boresight: Vector
    half_angle: float
    direction: Vector | None = None
    rate: Vector = (0.0, 0.0, 0.0)
    timeout: float = 0.0
    group: str = ""
    member: str = ""


@dataclass(frozen=True)
class Rules:
    """What a planner is configured to keep.

    Parameters
    ----------
    setpoint_rate
        [Hz]
    zones
        All of them.
    limits
        By `rate`, `acceleration`, `torque`, `momentum`: one number of the norm, or three.
    inertia
        By rows [kg m^2]; empty where unknown.
    """

    setpoint_rate: float = 50.0
    zones: tuple[Zone, ...] = ()
    limits: dict[str, tuple[float, ...]] = field(default_factory=dict)
    inertia: tuple[float, ...] = ()


@dataclass(frozen=True)
class Violation:
    """A sentence that did not hold: its name, what was seen, and the stamp [ns]."""

    sentence: str
    what: str
    stamp_ns: int


@dataclass
class _Place:
    direction: Vector
    stamp_ns: int | None
    changed_ns: int


class Monitor:
    """Hears messages in their order, and keeps what does not hold.

    Parameters
    ----------
    rules
        What is to be kept.

    Attributes
    ----------
    violations
        All of them; the first one is the verdict.
    setpoints
        How many were judged.
    """

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.violations: list[Violation] = []
        self.setpoints = 0
        self._last: State | None = None
        self._references: list[list[State]] = []
        self._off: set[str] = set()
        self._places = {
            zone.name: _Place(zone.direction, None, 0)
            for zone in rules.zones
            if zone.direction is not None
        }
        self._way_out = self._excused = False
        self._rest_by_ns: int | None = None
        self._warned_ns = -WARN_WITHIN_NS
        self._stale: set[str] = set()

    @property
    def verdict(self) -> Violation | None:
        """The first violation; None as long as there is none."""
        return self.violations[0] if self.violations else None

    def reference(self, samples: Sequence[State]) -> None:
        """Hear ~/reference; it counts from its first sample on."""
        if samples:
            self._references.append(list(samples))
            del self._references[:-_MOST_REFERENCES]

    def zone(self, name: str, direction: Vector, stamp_ns: int, now_ns: int) -> None:
        """Hear where the centre of a zone is."""
        length = norm(direction)
        if length > 0.0:
            unit = combined((1.0 / length, direction))
            self._places[name] = _Place(unit, stamp_ns, now_ns)
            self._stale.discard(name)

    def status(self, code: str, message: str, now_ns: int, *, warns: bool) -> None:
        """Hear ~/status, or the planner's part of /diagnostics."""
        if warns:
            self._warned_ns = now_ns
        if not code:
            return
        self._way_out = code == "WAY_OUT"
        self._excused = self._excused or code in _EXCUSED
        found = _STOP.search(message)
        if code == "CANCELLED" and found:
            self._rest_by_ns = now_ns + round(float(found.group(1)) / _SECOND)
        elif code in ("FLYING", "WAY_OUT", "DODGE", "STOP"):
            self._rest_by_ns = None

    def tick(self, now_ns: int) -> None:
        """Judge what depends on the time alone: M8."""
        for zone in self.rules.zones:
            place = self._places.get(zone.name)
            if zone.timeout <= 0.0 or place is None or place.stamp_ns is None:
                continue
            due = place.stamp_ns + round(zone.timeout / _SECOND) + WARN_WITHIN_NS
            late = now_ns > due and self._warned_ns < due - WARN_WITHIN_NS
            if late and zone.name not in self._stale:
                self._stale.add(zone.name)
                age = _SECOND * (now_ns - place.stamp_ns)
                self._found("M8", f"zone {zone.name} is {age:.3g} s old, and nothing warns", now_ns)

    def setpoint(self, state: State) -> None:
        """Judge a setpoint."""
        self.setpoints += 1
        before, self._last = self._last, state
        judges: tuple[tuple[str, Callable[[State, State], str]], ...] = (
            ("M1", self._one_sign),
            ("M2", self._steady),
            ("M3", self._no_leap),
        )
        for sentence, judge in judges:
            if before is not None and (what := judge(before, state)):
                self._found(sentence, what, state.stamp_ns)
        self._excused = False
        if abs(norm(state.q) - 1.0) > UNIT:
            self._found("M1", f"the quaternion's norm is {norm(state.q):.9g}", state.stamp_ns)
        for what in self._beyond(state):
            self._found("M5", what, state.stamp_ns)
        if self._rest_by_ns is not None and state.stamp_ns > self._rest_by_ns:
            if norm(state.v) > AT_REST:
                self._found("M7", f"it turns at {norm(state.v):.3g} rad/s", state.stamp_ns)
            self._rest_by_ns = None
        # Messages of other topics may be under way: what they may explain must last.
        self._lasting("M4", self._entered(state), state.stamp_ns)
        self._lasting("M6", self._astray(state), state.stamp_ns)

    def _found(self, sentence: str, what: str, stamp_ns: int) -> None:
        self.violations.append(Violation(sentence, what, stamp_ns))

    def _lasting(self, sentence: str, what: str, stamp_ns: int) -> None:
        """A violation that is seen at two setpoints in a row."""
        if what and sentence in self._off:
            self._found(sentence, what, stamp_ns)
        (self._off.add if what else self._off.discard)(sentence)

    def _one_sign(self, before: State, state: State) -> str:
        product = dot(before.q, state.q)
        return "" if product > 0.0 else f"the quaternion's sign flips: dot product {product:.3g}"

    def _steady(self, before: State, state: State) -> str:
        interval = state.stamp_ns - before.stamp_ns
        if interval <= 0 and not self._excused:
            return f"the stamp goes back by {-_SECOND * interval:.3g} s"
        most = 2.0 / (self.rules.setpoint_rate * _SECOND)
        if interval > most + 1.0 and not self._excused:
            return f"{_SECOND * interval:.3g} s between two setpoints"
        return ""

    def _no_leap(self, before: State, state: State) -> str:
        interval = _SECOND * (state.stamp_ns - before.stamp_ns)
        turn = norm(turn_between(before.q, state.q))
        # Between the two the rate may pass both by what the accelerations add in half of it.
        extra = 0.5 * interval * max(norm(before.a), norm(state.a))
        most = (max(norm(before.v), norm(state.v)) + extra) * interval + TURN
        if interval <= 0.0 or turn <= most:
            return ""
        return f"a turn of {turn:.3g} rad where rates allow {most:.3g} rad"

    def _entered(self, state: State) -> str:
        """The set that a setpoint violates, if the planner has had time to answer."""
        if self._way_out:
            return ""
        members: dict[str, dict[str, str]] = {}
        for zone in self.rules.zones:
            group, member = zone.group or zone.name, zone.member or zone.name
            kept = members.setdefault(group, {}).get(member, "")
            members[group][member] = kept or self._inside(zone, state)
        for parts in members.values():
            if all(parts.values()):
                return " and ".join(parts.values())
        return ""

    def _inside(self, zone: Zone, state: State) -> str:
        place = self._places.get(zone.name)
        if place is None or (state.stamp_ns < place.changed_ns + GRACE_NS and place.changed_ns):
            return ""
        since = 0.0 if place.stamp_ns is None else _SECOND * (state.stamp_ns - place.stamp_ns)
        centre = about(combined((since, zone.rate)), place.direction)
        distance = angle_between(turned(state.q, zone.boresight), centre)
        beyond = (distance - zone.half_angle) * (1.0 if zone.keep_in else -1.0)
        return f"{zone.name} is passed by {beyond:.3g} rad" if beyond >= 0.0 else ""

    def _beyond(self, state: State) -> list[str]:
        """Limits that a setpoint passes."""
        values = {"rate": state.v, "acceleration": state.a}
        J = self.rules.inertia
        if J:
            rows = ((J[0], J[1], J[2]), (J[3], J[4], J[5]), (J[6], J[7], J[8]))
            momentum = (dot(rows[0], state.v), dot(rows[1], state.v), dot(rows[2], state.v))
            driven = (dot(rows[0], state.a), dot(rows[1], state.a), dot(rows[2], state.a))
            torque = combined((1.0, driven), (1.0, cross(state.v, momentum)))
            values |= {"momentum": momentum, "torque": torque}
        found = []
        for name, bounds in self.rules.limits.items():
            value = values.get(name)
            if value is None or not bounds:
                continue
            sizes = [norm(value)] if len(bounds) == 1 else [abs(x) for x in value]
            used = max(size / bound for size, bound in zip(sizes, bounds, strict=True))
            if used > 1.0 + LIMIT:
                found.append(f"{name} is {used:.9g} of its limit")
        return found

    def _astray(self, state: State) -> str:
        """How far a setpoint is from the reference that counts at its stamp."""
        known = [r for r in self._references if r[0].stamp_ns <= state.stamp_ns]
        if not known:
            return ""
        samples = known[-1]
        expected, slack = _attitude(samples, state.stamp_ns)
        off = norm(turn_between(expected, state.q))
        return f"{off:.3g} rad off the reference" if off > ON_REFERENCE + slack else ""


def _attitude(samples: list[State], stamp_ns: int) -> tuple[Quaternion, float]:
    """Attitude of a reference at a stamp, and how far its samples leave it open [rad].

    Where acceleration jumps between two samples, as at the begin of a stop, the curve through
    both is off by up to the jump times h^2 / 32. A jump is what the neighbouring intervals do not
    show as well.
    """
    k = bisect_right([sample.stamp_ns for sample in samples], stamp_ns) - 1
    if k >= len(samples) - 1:
        return samples[-1].q, 0.0
    before, after = samples[k], samples[k + 1]
    h = _SECOND * (after.stamp_ns - before.stamp_ns)
    beside = [_gain(samples, j) for j in (k - 1, k + 1) if 0 <= j < len(samples) - 1]
    share = 1.0 / max(len(beside), 1)
    jump = norm(combined((1.0, _gain(samples, k)), *((-share, gain) for gain in beside)))
    return between(before, after, stamp_ns), jump * h * h / 32.0


def _gain(samples: list[State], k: int) -> Vector:
    """Acceleration gained from sample k to the next."""
    return combined((1.0, samples[k + 1].a), (-1.0, samples[k].a))
