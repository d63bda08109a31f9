# SPDX-License-Identifier: Apache-2.0
"""riem_check PROBLEM PLAN: prove that a plan does what its problem asks at all times, or refute it.

All that is trusted is this file, the standard library and python-flint. Every number is read as
an exact decimal and computed with in balls (arb: outward rounding, 128 bits), so that a
comparison that comes out true is true. docs/proof.md states what is proven.

Each formula is written once, on truncated power series in the time within an interval, with
balls as coefficients. On a piece [m - r, m + r] the series at m gives the coefficients 0 to 3 of
a function f, the series at the ball [m - r, m + r] the fourth, and
`f_0 - |f_1| r - max(0, -f_2) r^2 - |f_3| r^3 - max(0, -f_4) r^4` is a lower bound of f. Positive:
proven. f_0 < 0: refuted. Else the piece is halved.

Exit codes, the greatest of all pairs: 0 proven, 2 bad (malformed, or with a key that this file
does not know), 3 refuted (what, when, by how much), 4 undecided (where).
"""

from __future__ import annotations

import json
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterable
from decimal import Decimal, InvalidOperation
from functools import cache, cached_property, partial
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from flint import arb, arb_poly, ctx
from flint import arb_series as Series  # noqa: N812 (a type's name)

BUDGET = 20_000  # pieces a plan
CODES = {"proven": 0, "bad": 2, "refuted": 3, "undecided": 4}
TINY, CLAIM, SMALL = arb("1e-9"), arb("1e-10"), arb("1e-6")  # ends, limits; claims; roll, holds
TOP = "name boresight tension normalized_tension obstacles limits inertia hold objective"
PLACE = " boresight direction rate times directions"
COMMON = " name strength normalized_strength range_deg active"  # strengths and ranges prove nothing
ZONE = COMMON + PLACE + " group member half_angle_deg half_angles_deg"
KINDS = {"orientation": COMMON + " orientation rate radius_deg", "keep_out": ZONE, "keep_in": ZONE}
ENDS = "orientation angular_velocity", "orientation rate", PLACE + " second"
ENDS_ON_S2 = "orientation angular_velocity", "orientation velocity", "direction velocity"
RIGID = " momentum torque torque_rate"  # the limits that need the inertia
SIZES = "radius_deg", "half_angle_deg", "half_angles_deg"
SAMPLES = "times orientations_xyzw angular_velocities angular_accelerations"
TOLD = """name status message cost certified local_minimum iterations solve_time_s alternatives
    problem trajectory_error cost_error notes least_clearance_time boundary_error rate_bound
    limits_left duration clearance_deg wall goal_index hold"""  # some is judged: see `examine`

ctx.prec, ctx.cap = 128, 6  # bits; terms: five, and one more for what is differentiated

# Reading


class Verdict(Exception):  # noqa: N818 (an answer, no error)
    """What is known of a pair as soon as it is known: a word of CODES, and why."""


def need(holds: object, why: str, word: str = "bad") -> None:
    """End with a verdict unless something certainly holds."""
    if not holds:
        raise Verdict(word, why)


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A mapping of JSON, whose keys must differ."""
    need(len({key for key, _ in pairs}) == len(pairs), "a key stands twice in a mapping")
    return dict(pairs)


def parsed(text: str) -> Any:
    """Value of a JSON text, its numbers as Decimal; `int` refuses NaN and Infinity."""
    hooks: dict[str, Any] = {"parse_float": Decimal, "parse_int": Decimal, "parse_constant": int}
    try:
        return json.loads(text, object_pairs_hook=unique, **hooks)
    except (ValueError, RecursionError, InvalidOperation) as error:
        raise Verdict("bad", f"not JSON: {error}") from None


def fields(value: Any, where: str, required: str, optional: str = "") -> dict[str, Any]:
    """A mapping that has the required keys, and others only of the optional ones."""
    need(isinstance(value, dict), f"{where}: expected a mapping")
    known = {*required.split(), *optional.split()}
    for key in value.keys() - known:
        need(key.startswith("best_known_"), f"{where}: {key!r} is unknown, so nothing is proven")
    need(value.keys() >= {*required.split()}, f"{where}: expected at least {required}")
    return dict(value)


def sequence(value: Any, what: str, count: int = 0) -> list[Any]:
    """A list, of `count` entries where that is given."""
    need(isinstance(value, list) and count in (0, len(value)), f"{what}: expected {count} values")
    return list(value)


def number(value: Any, what: str) -> Decimal:
    """An exact number."""
    need(isinstance(value, Decimal), f"{what}: expected a number, got {value}")
    return Decimal(value)


def ball(value: Any, what: str) -> arb:
    """The ball about an exact number."""
    return arb(str(number(value, what)))


def balls(value: Any, what: str, count: int = 3) -> list[arb]:
    """A list of numbers as balls."""
    return [ball(entry, what) for entry in sequence(value, what, count)]


def root(square: arb) -> arb:
    """Root of what is no less than 0, even where its ball touches 0."""
    return square.sqrt() if square > 0 else arb(0).union(square.upper().sqrt())


def unit(value: Any, what: str, off: str = "inf", count: int = 3) -> list[arb]:
    """A vector or quaternion over its norm, which is off 1 by no more than `off`."""
    values = balls(value, what, count)
    norm = root(sum((x * x for x in values), arb(0)))
    need(norm > 0 and abs(norm - 1) <= arb(off), f"{what}: its norm is {float(norm):.9g}")
    return [x / norm for x in values]


# Vectors and rotations on series


class Vector(tuple[Series, ...]):
    """Three series, equal to themselves only."""

    __hash__ = object.__hash__

    def __add__(self, b: Vector) -> Vector:  # type: ignore[override]
        return Vector((self[0] + b[0], self[1] + b[1], self[2] + b[2]))

    def __sub__(self, b: Vector) -> Vector:
        return Vector((self[0] - b[0], self[1] - b[1], self[2] - b[2]))

    def __mul__(self, c: Series | arb | int) -> Vector:  # type: ignore[override]
        return Vector(x * c for x in self)

    def __matmul__(self, b: Vector) -> Series:
        return self[0] * b[0] + self[1] * b[1] + self[2] * b[2]

    def __xor__(self, b: Vector) -> Vector:
        (x, y, z), (X, Y, Z) = self, b
        return Vector((y * Z - z * Y, z * X - x * Z, x * Y - y * X))

    def unit(self) -> Vector:
        """The vector over its norm; not a number where that may be 0."""
        return self * (self @ self).rsqrt()

    def norm(self) -> arb:
        """Norm of the constant terms."""
        return root((self @ self)[0])

    def rate(self) -> Vector:
        """Derivative."""
        return Vector(x.derivative() for x in self)


Quaternion = tuple[Vector, Series]  # vector and real part


def vector(values: Iterable[Any]) -> Vector:
    """A vector of constants."""
    return Vector(Series([x]) for x in values)


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton's product."""
    return q[0] * p[1] + p[0] * q[1] + (p[0] ^ q[0]), p[1] * q[1] - p[0] @ q[0]


def rotated(q: Quaternion, b: Vector) -> Vector:
    """A vector of the body in the reference frame."""
    c = (q[0] ^ b) * 2
    return b + c * q[1] + (q[0] ^ c)


def size(vectors: list[Vector]) -> arb:
    """What one vector, or an attitude by its three axes, differs by from another: 2 sin(e/2)."""
    return root(sum((x.norm() ** 2 for x in vectors), arb(0)) / (1 if len(vectors) == 1 else 2))


AXES = [vector(int(i == j) for j in range(3)) for i in range(3)]
ZERO, X = ([Decimal(x), Decimal(0), Decimal(0)] for x in (0, 1))
IDENTITY = [Decimal(int(i % 4 == 0)) for i in range(9)]


def phis(z: Series) -> list[Series]:
    """phi_0 to phi_5, `phi_n(z) = sum_j (-z)^j / (2j + n)!`: cos x, sin x / x, .. at z = x^2.

    By `phi_n = 1/n! - z phi_(n+2)` from phi_M and phi_(M+1), whose k-th Taylor coefficients are
    at most `(1 - |z|/M^2)^-(k+1) / M!`, less than 2 / M! for k < 6 as M^2 > 64 |z|.
    """
    size = float(abs(z[0]).upper()) ** 0.5
    need(size < 100, "a turn of more than 100 radians between two samples", "undecided")
    shift, powers, M = z - z[0], Series([1]), 18 + 2 * int(4 * size)
    for _ in range(ctx.cap):
        powers = shift * powers + 1
    found = [powers * arb(0, 2 / arb.fac_ui(M))] * 2
    for m in reversed(range(M)):
        found.append(Series([1 / arb.fac_ui(m)]) - z * found[-2])
    return found[:-7:-1]


def moved(xi: Vector, xi_1: Vector, xi_2: Vector, phi: list[Series]) -> tuple[Vector, Vector]:
    """Body rate and acceleration of exp(xi) from xi and its two derivatives."""
    c, turned, inner = xi ^ xi_1, xi ^ xi_2, xi @ xi_1
    v = xi_1 - c * phi[2] + (xi ^ c) * phi[3]
    a = xi_2 - turned * phi[2] - c * (inner * (phi[4] * 2 - phi[3]))
    a += (xi ^ c) * (inner * (phi[5] * 3 - phi[4])) + ((xi_1 ^ c) + (xi ^ turned)) * phi[3]
    return v, a


# The curve that a plan means


class Curve:
    """Samples of a plan: exact times, unit quaternions, rates and accelerations as balls."""

    def __init__(self, plan: dict[str, Any], where: str) -> None:
        rows = [sequence(plan[key], where + key, len(plan["times"])) for key in SAMPLES.split()]
        self.times = [number(t, where + "times") for t in rows[0]]
        rising = all(map(Decimal.__lt__, self.times, self.times[1:]))
        need(rising and self.times[1:], f"{where}times: expected increasing ones", "refuted")
        self.t = [ball(t, "") for t in self.times]
        self.h, self.inertia = [after - before for before, after in pairwise(self.t)], AXES
        rows[1] = [unit(q, where + "orientations_xyzw", "1e-9", 4) for q in rows[1]]
        self.q: list[Quaternion] = [(vector(q[:3]), Series(q[3:])) for q in rows[1]]
        self.v, self.a = ([vector(balls(x, where + "rates")) for x in row] for row in rows[2:])
        self.duration = self.t[-1] - self.t[0]
        self.fastest = max((v.norm().upper() for v in self.v), key=float)
        self.roll = SMALL * self.fastest + TINY / self.duration  # the greatest allowed, on s2

    def quintic(self, k: int) -> list[arb_poly]:
        """Components of xi, `q_k exp(xi(u))` from sample k to the next, u from 0 to 1.

        Raises
        ------
        Verdict
            The samples are too far apart, or jump.
        """
        h, half, where = Series([self.h[k]]), Series([arb(1) / 2]), f"after {self.times[k]} s"
        x, w = product((self.q[k][0] * -1, self.q[k][1]), self.q[k + 1])
        need(w[0] >= (arb("0.45") * arb.pi()).cos(), f"a turn past 162 degrees {where}", "refuted")
        D = x * (2 / arb.atan2(x.norm(), w[0]).sinc())
        v0, v1, a0, a1 = self.v[k], self.v[k + 1], self.a[k], self.a[k + 1]
        jump = (D - (v0 + v1) * h * half - (a0 - a1) * (h * h / 12)).norm()
        smooth = len(self.t) == 2 or jump <= h[0] * self.fastest / 10 + TINY
        need(smooth, f"a jump of {float(jump):.3g} rad {where}", "refuted")
        phi = phis(D @ D)
        C = (phi[3] - phi[4] * 2) / (phi[2] * 2)

        def G(w: Vector) -> Vector:
            return w + (D ^ w) * half + (D ^ (D ^ w)) * C

        V0, A0, V1 = v0 * h, a0 * (h * h) * half, G(v1 * h)
        A1 = G(a1 * (h * h) - moved(D, V1, D * 0, phi)[1])
        d, d1, d2 = D - V0 - A0, V1 - V0 - A0 * 2, (A1 - A0 * 2) * half
        higher = d * 10 - d1 * 4 + d2, d1 * 7 - d * 15 - d2 * 2, d * 6 - d1 * 3 + d2
        return [arb_poly([x[0] for x in row]) for row in zip(D * 0, V0, A0, *higher, strict=True)]


class Point:
    """A curve about a time: series in u about a ball, each computed when first asked for."""

    def __init__(self, curve: Curve, k: int, quintic: list[arb_poly], u: arb, at: Decimal) -> None:
        self.h, self.at, self._curve = curve.h[k], at, curve
        self.time = Series([curve.t[k] + self.h * u, self.h])
        xi = [p(arb_poly([u, 1])) for p in quintic]
        first = [p.derivative() for p in xi]
        self._xi: Any = [
            Vector(map(Series, x)) for x in (xi, first, [p.derivative() for p in first])
        ]
        phi = phis(self._xi[0] @ self._xi[0] / 4)
        attitude = product(curve.q[k], (self._xi[0] * (phi[1] / 2), phi[0]))
        self.pointing = cache(partial(rotated, attitude))  # of directions of the body

    @cached_property
    def motion(self) -> dict[str, Vector]:
        """What limits bound, in body components, and SI units and radians."""
        v, a = moved(self._xi[0], self._xi[1], self._xi[2], phis(self._xi[0] @ self._xi[0]))
        v, a, per = v * (1 / self.h), a * (1 / self.h**2), 1 / self.h
        momentum, torque = (Vector(row @ x for row in self._curve.inertia) for x in (v, a))
        torque += v ^ momentum
        found = {"rate": v, "acceleration": a, "momentum": momentum, "torque": torque}
        return found | {"jerk": a.rate() * per, "torque_rate": torque.rate() * per}


# What is demanded of it


class Clause(NamedTuple):
    """A function of the curve that must be positive, within the windows if there are any.

    With it `f` returns how much is too much where it is not, for the report.
    """

    f: Callable[[Point], tuple[Series, Callable[[], arb]]]
    windows: list[list[Decimal]] | None = None

    def stands(self, begin: Decimal, end: Decimal) -> bool:
        """Whether it counts between two times, which no edge of a window parts."""
        return self.windows is None or any(a <= begin and end <= b for a, b in self.windows)

    def judge(self, centre: Point, whole: Point, r: arb) -> int:
        """1 where it holds on a piece, -1 where it does not at the centre, else 0."""
        c, fourth = self.f(centre)[0], self.f(whole)[0][4]
        bound = c[0] - abs(c[1]) * r - (-c[2]).max(0) * r**2 - abs(c[3]) * r**3
        return -1 if c[0] < 0 else int(bound - (-fourth).max(0) * r**4 > 0)


Demand = tuple[str, list[list[Clause]]]  # a name, and members: at each time one must hold whole


def smaller(name: str, what: Any, bound: arb, along: Any = None) -> Demand:
    """The norm of a motion or function, or its part along a vector, is a bound at most."""
    need(bound > 0, f"{name}: expected a bound above 0")

    def f(p: Point) -> tuple[Series, Callable[[], arb]]:
        x = p.motion[what] if isinstance(what, str) else what(p)
        part = x @ x if along is None else (x @ along) ** 2
        used = part / (bound * (1 + TINY)) ** 2
        return 1 - used, lambda: root(used[0])

    return name, [[Clause(f)]]


def prove(curve: Curve, demands: list[Demand], edges: Iterable[Decimal]) -> int:
    """Prove demands at all times of a curve; returns the number of pieces it took.

    Between neighbouring `edges` and samples all splines are cubics and no window opens or closes.

    Raises
    ------
    Verdict
        Refuted, or undecided.
    """
    grid = sorted({*curve.times, *(x for x in edges if curve.times[0] < x < curve.times[-1])})
    count, quintics = 0, [curve.quintic(k) for k in range(len(curve.h))]
    for begin, end in [(grid[0], grid[0]), *pairwise(grid), (grid[-1], grid[-1])]:
        k = min(bisect_right(curve.times, begin), len(quintics)) - 1
        ends = [(ball(t, "") - curve.t[k]) / curve.h[k] for t in (begin, end)]
        standing = [(n, [[c for c in m if c.stands(begin, end)] for m in ms]) for n, ms in demands]
        stack: list[Any] = [(*ends, [demand for demand in standing if all(demand[1])])]
        while stack:
            left, right, pending = stack.pop()
            piece, count, waiting = left.union(right), count + 1, []
            centre, whole = (Point(curve, k, quintics[k], u, begin) for u in (piece.mid(), piece))
            time = f"at {float(centre.time[0]):.9g} s"
            for name, members in pending:
                state = max(min(c.judge(centre, whole, piece.rad()) for c in m) for m in members)
                wrong = [float(c.f(centre)[1]()) for m in members for c in m if state < 0]
                need(not wrong, f"{name} {time}: {wrong}", "refuted")
                waiting += [(name, members)] * (state == 0)
            need(not waiting or count < BUDGET, f"{[x[0] for x in waiting]} {time}", "undecided")
            stack += [(piece.mid(), right, waiting), (left, piece.mid(), waiting)] * bool(waiting)
    return count


Place = Callable[[Series, Decimal], Any]  # at a time; the exact one picks a spline's segment
Pairs = list[tuple[Vector, Place]]  # directions of the body, and the places they are compared with


def turning(s: Vector, rate: list[arb]) -> Place:
    """A place turned by the rotation vector `rate t`."""
    speed = vector(rate).norm()

    def place(time: Series, at: Decimal) -> Vector:
        sine, cosine = (time * (speed / 2)).sin_cos()
        return rotated((vector(rate) * (sine / speed), cosine), s)

    return place if speed > 0 else lambda time, at: s


def spline(t: list[arb], y: list[arb]) -> list[arb_poly]:
    """Segments of the not-a-knot cubic spline, each in the time since it began.

    The second derivatives M solve a tridiagonal system once the conditions at the second and the
    last but one knot, where the third derivative is continuous, have given the first and last.
    """
    n, h = len(y) - 1, [after - before for before, after in pairwise(t)]
    slope = [(y[i + 1] - y[i]) / h[i] for i in range(n)]
    M = [6 * (after - before) for before, after in pairwise(slope)]
    rows = [[h[i], 2 * (h[i] + h[i + 1]), h[i + 1]] for i in range(n - 1)]
    for row, inner, a, b in ((rows[0], 2, h[0], h[1]), (rows[-1], 0, h[-1], h[-2])):
        row[1] += a * (a + b) / b
        row[inner] -= a * a / b
    for i in range(1, n - 1):
        factor = rows[i][0] / rows[i - 1][1]
        rows[i][1] -= factor * rows[i - 1][2]
        M[i] -= factor * M[i - 1]
    M[-1] /= rows[-1][1]
    for i in range(n - 3, -1, -1):
        M[i] = (M[i] - rows[i][2] * M[i + 1]) / rows[i][1]
    M.insert(0, M[0] + (M[0] - M[1]) * h[0] / h[1])
    M.append(M[-1] + (M[-1] - M[-2]) * h[-1] / h[-2])
    first = [slope[i] - h[i] * (2 * M[i] + M[i + 1]) / 6 for i in range(n)]
    return [arb_poly([y[i], first[i], M[i] / 2, (M[i + 1] - M[i]) / (6 * h[i])]) for i in range(n)]


class Problem:
    """What a problem's document demands of a plan that ends at a time.

    `sets` are the clauses by forbidden set and member, `caps` by name the body axis, centre and
    half-angle of what a single fixed zone forbids, `edges` the times at which clauses change form.
    """

    def __init__(self, document: Any, claims: Any, until: Decimal) -> None:
        self.top = fields(document, "problem", "space duration start goal", TOP)
        self.sphere, self.until, self.claims = self.top["space"] == "s2", until, claims
        need(isinstance(claims, dict), "clearance_deg: expected a mapping")
        need(self.sphere or self.top["space"] == "so3", "space: expected so3 or s2")
        T, aim = self.top["duration"], self.top.get("objective", "least_acceleration")
        need(T == "auto" or number(T, "duration") > 0, "duration: expected more than 0")
        need(aim in ["least_time", "least_acceleration"][T != "auto" :], f"objective: not {aim}")
        self.hold, self.goals = number(self.top.get("hold", Decimal(0)), "hold"), [self.top["goal"]]
        if isinstance(self.goals[0], dict) and "any_of" in self.goals[0]:
            self.goals = sequence(fields(self.goals[0], "goal", "any_of")["any_of"], "goal.any_of")
        self.edges: set[Decimal] = set()
        self.axes: dict[Any, Vector] = {}
        self.boresight = self.axis({})
        self.caps: dict[str, tuple[Vector, Vector, arb]] = {}
        self.sets: dict[str, dict[Any, list[Clause]]] = {}
        entries = sequence(self.top.get("obstacles", []), "obstacles")
        names = [self.obstacle(entry, f"obstacles[{i}]", str(i)) for i, entry in enumerate(entries)]
        names += {entry["group"] for entry in entries if "group" in entry}
        need(len({*names}) == len(names), "obstacles: a name stands twice")
        need(claims.keys() <= self.sets.keys(), "clearance_deg: expected names of what there is")

    def axis(self, entry: dict[str, Any]) -> Vector:
        """The boresight of an entry; the same object for the same numbers."""
        value = entry.get("boresight", self.top.get("boresight", X))
        b = vector(unit(value, "boresight"))
        if not (self.sphere and self.axes):
            return self.axes.setdefault(tuple(value), b)
        need((b - self.boresight).norm() < TINY, "boresight: on s2 expected the problem's")
        return self.boresight

    def place(self, entry: dict[str, Any], where: str) -> Place:
        """Where a direction is: fixed, turning or sampled."""
        need(("direction" in entry) != ("directions" in entry), f"{where}: expected one direction")
        if "direction" in entry:
            s = vector(unit(entry["direction"], where))
            return turning(s, balls(entry.get("rate", ZERO), where))
        need("rate" not in entry, f"{where}.rate: expected none beside directions")
        rows = [unit(s, where) for s in sequence(entry["directions"], where)]
        parts = [self.sampled(entry, list(y), where) for y in zip(*rows, strict=True)]
        return lambda time, at: Vector(part(time, at) for part in parts).unit()

    def sampled(self, entry: dict[str, Any], y: list[arb], where: str) -> Place:
        """The spline through values at an entry's times."""
        times = sequence(entry.get("times"), f"{where}.times", max(len(y), 4))
        knots = [ball(t, where) for t in times]
        rising = all(map(Decimal.__lt__, times, times[1:])) and times[0] <= 0
        covered = rising and ball(self.until, "") <= knots[-1] * (1 + TINY)
        need(covered, f"{where}.times: expected increasing ones that cover the plan")
        self.edges |= {*times}
        segments = spline(knots, y)

        def value(time: Series, at: Decimal) -> Series:
            i = min(bisect_right(times, at), len(segments)) - 1
            return Series(segments[i](arb_poly([time[0] - knots[i], time[1]])))

        return value

    def pairs(self, entry: dict[str, Any], where: str) -> Pairs:
        """Axes of the body and where an attitude has them; or a boresight and its place."""
        if "orientation" in entry:
            *q, w = unit(entry["orientation"], where, "1e-3", 4)
            rate = balls(entry.get("rate", ZERO), where)
            axes = [self.boresight] if self.sphere else AXES
            return [(b, turning(rotated((vector(q), Series([w])), b), rate)) for b in axes]
        b, place = self.axis(entry), self.place(entry, where)
        if "second" not in entry:
            return [(b, place)]
        other = fields(entry["second"], f"{where}.second", "boresight", PLACE)
        n, second = (b ^ self.axis(other)).unit(), self.place(other, f"{where}.second")

        def normal(time: Series, at: Decimal) -> Any:
            return (place(time, at) ^ second(time, at)).unit()

        return [(b, place), (n, normal), (n ^ b, lambda t, at: normal(t, at) ^ place(t, at))]

    def obstacle(self, entry: Any, where: str, index: str) -> str:
        """Read an obstacle; returns its name."""
        kind = entry.get("kind") if isinstance(entry, dict) else None
        need(kind in [*KINDS][self.sphere :], f"{where}.kind: {kind!r} is unknown")
        fields(entry, where, "kind", KINDS[str(kind)])
        name, sign, degree = entry.get("name", index), 1 - 2 * (kind == "keep_in"), arb.pi() / 180
        group, member = entry.get("group", name), (entry.get("member", name), "member" in entry)
        texts = all(isinstance(x, str) and x.strip() for x in (name, group, member[0]))
        need(texts, f"{where}: expected texts as names")
        balls([entry.get(x, Decimal(1)) for x in ("strength", "normalized_strength")], where, 2)
        pairs, sizes = self.pairs(entry, where), [x for x in entry if x in SIZES]
        need(len(sizes) < 2, f"{where}: expected at most one of {sizes}")
        given = entry[sizes[0]] if sizes else Decimal(0)
        sampled = sizes == ["half_angles_deg"]
        angles = [x * degree for x in balls(given if sampled else [given], where, 0)]
        fits = all(0 <= x < arb.pi() and (sign > 0 or x > 0) for x in angles)
        need(fits, f"{where}: expected angles below 180 degrees")
        radius = self.sampled(entry, angles, where) if sampled else lambda t, at: Series(angles)
        claim = (ball(self.claims.get(group, Decimal(0)), "clearance_deg") * degree - CLAIM).max(0)

        def f(p: Point) -> tuple[Series, Callable[[], arb]]:
            cosine = sum((p.pointing(b) @ s(p.time, p.at) for b, s in pairs), Series([0]))
            cosine = cosine if len(pairs) == 1 else (cosine - 1) / 2
            r = radius(p.time, p.at) + claim * sign
            inside = (
                1 if 0 <= r[0] <= arb.pi() else -1 if r[0] < 0 or r[0] > arb.pi() else arb("nan")
            )
            value = (r.cos() - cosine) * sign if inside == 1 else Series([inside])
            return value, lambda: (r[0] - arb.atan2(root(1 - cosine[0] ** 2), cosine[0])) * sign

        windows = [sequence(x, where, 2) for x in sequence(entry.get("active", []), where)]
        opens = all(number(a, where) < number(b, where) for a, b in windows)
        need(opens, f"{where}.active: expected [start, end] with start < end")
        self.edges |= {edge for window in windows for edge in window}
        clause = Clause(f, windows if "active" in entry else None)
        self.sets.setdefault(group, {}).setdefault(member, []).append(clause)
        special = {"times", "active", "orientation", "group"} & entry.keys()
        if not special and entry.get("rate", ZERO) == ZERO:
            s = pairs[0][1](Series([0]), Decimal(0)) * sign
            self.caps[name] = (pairs[0][0], s, angles[0] if sign > 0 else arb.pi() - angles[0])
        return str(name)

    def end(self, entry: Any, key: str) -> Pairs:
        """The body axes of an end state with the places they are to have."""
        forms = ENDS_ON_S2 if self.sphere else ENDS[: 3 if key == "goal" else 1]
        given = {*entry} if isinstance(entry, dict) else {""}
        need(any(given <= {*form.split()} for form in forms), f"{key}: expected one of {forms}")
        return self.pairs(entry, key)

    def meet(self, curve: Curve, k: int, key: str, entry: Any) -> Pairs:
        """Refuse a curve whose sample k is not an end state; returns what the end points at."""
        pairs, q, v, T = self.end(entry, key), curve.q[k], curve.v[k], curve.duration
        places = [place(Series([curve.t[k], 1]), curve.times[k]) for _, place in pairs]
        miss = size([rotated(q, b) - s for (b, _), s in zip(pairs, places, strict=True)])
        need(2 * (miss / 2).asin() <= TINY, f"{key}: missed by {float(miss):.6g} rad", "refuted")
        rates = [s.rate() for s in places]
        if "velocity" in entry:
            rates = [vector(balls(entry["velocity"], key))]
        if "angular_velocity" in entry:
            w = vector(balls(entry["angular_velocity"], key))
            rates = [rotated(q, w ^ b) for b, _ in pairs]
        off = size([rotated(q, v ^ b) - s for (b, _), s in zip(pairs, rates, strict=True)])
        off += abs((v @ pairs[0][0])[0]) * (len(pairs) == 1 and not self.sphere)
        met = T * off <= TINY * (1 + T * size(rates))
        need(met, f"{key}: rate missed by {float(off):.6g} rad/s", "refuted")
        return pairs

    def bounds(self, curve: Curve) -> list[Demand]:
        """Demands of what the spacecraft can do, and on s2 that it does not roll."""
        limits = fields(self.top.get("limits", {}), "limits", "", "rate acceleration jerk" + RIGID)
        need("inertia" in self.top or not {*RIGID.split()} & limits.keys(), "inertia: missing")
        J = balls(self.top.get("inertia", IDENTITY), "inertia", 9)
        curve.inertia = [vector(J[i : i + 3]) for i in (0, 3, 6)]
        demands = [smaller("roll", "rate", curve.roll, self.boresight)] if self.sphere else []
        for key, value in limits.items():
            one = not isinstance(value, list)
            values = balls([value] if one else value, key, 1 if one else 3)
            for axis, bound in zip([None] if one else AXES, values, strict=True):
                demands.append(smaller(key, key, bound, axis))
        for a in (curve.a[0], curve.a[-1]) if {"jerk", "torque_rate"} & limits.keys() else ():
            need(any(a.norm() <= SMALL * b.norm() for b in curve.a), "jerk: not at rest", "refuted")
        return demands

    def wall(self, names: list[Any]) -> None:
        """Refuse a chain of zones unless it parts the start from every goal.

        The arcs between neighbours' centres are forbidden; a way from the start to a goal that
        crosses their closed chain an odd number of times has its ends in different parts.
        """
        single = len(names) > 2 and all(isinstance(x, str) and x in self.caps for x in names)
        need(single, "wall: expected three or more names of single fixed zones")
        chain = [self.caps[x] for x in [*names, names[0]]]
        b = chain[0][0]
        need(all(x[0] is b for x in chain), "wall: zones of more than one boresight", "refuted")
        for (_, s, r), (_, t, q) in pairwise(chain):
            gap = arb.atan2((s ^ t).norm(), (s @ t)[0]) - r - q
            need(gap <= 0, f"wall: a gap of {float(gap):.6g} rad", "refuted")
        arcs = [(x[1], y[1]) for x, y in pairwise(chain)]
        ends = [self.end(x, "goal") for x in self.goals]
        start, *goals = [self.bearing(x, b) for x in [self.end(self.top["start"], "start"), *ends]]
        vias = [vector(x).unit() for x in ((3, 5, -7), (-5, 2, 3), (2, -7, -1))]
        for goal in goals:
            tries = ([crosses(x, via, *arc) for x in (start, goal) for arc in arcs] for via in vias)
            found: Any = next((found for found in tries if None not in found), [None])
            need(None not in found, "wall: what crosses it is not known", "undecided")
            need(found.count(True) % 2 == 1, "wall: it does not part the ends", "refuted")

    def bearing(self, pairs: Pairs, b: Vector) -> Any:
        """Where an end state at rest has a body axis."""
        places = [place(Series([0, 1]), Decimal(0)) for _, place in pairs]
        need(all(x.rate().norm() == 0 for x in places), "wall: the goal moves", "undecided")
        need(len(pairs) > 1 or pairs[0][0] is b, "wall: the goal leaves its axis free", "undecided")
        parts = [x * (b @ axis) for x, (axis, _) in zip(places, pairs, strict=True)]
        return sum(parts[1:], parts[0])


def crosses(a: Vector, b: Vector, c: Vector, d: Vector) -> Any:
    """Whether the arcs ab and cd of the sphere cross; None where that is not certain."""
    turns = [((x ^ y) @ z)[0] for x, y, z in ((a, c, b), (c, b, d), (b, d, a), (d, a, c))]
    signs = {(x > 0) - (x < 0) for x in turns}
    return len(signs) == 1 if signs >= {1, -1} or 0 not in signs else None


def examine(problem: str, plan: str) -> str:
    """What is proven of a pair of texts.

    Raises
    ------
    Verdict
        It is bad, refuted or undecided.
    """
    found, document = fields(parsed(plan), "plan", SAMPLES, TOLD), parsed(problem)
    names, claims = sequence(found.get("wall", []), "wall"), found.get("clearance_deg", {})
    if not sequence(found["times"], "times"):
        need(names, "the plan holds neither a trajectory nor a wall", "undecided")
        Problem(document, {}, Decimal(0)).wall(names)
        return f"wall of {len(names)} zones"
    need(not names, "wall: expected none beside a trajectory")
    curve = Curve(found, "")
    rest: Any = found.get("hold")
    held = None if rest is None else Curve(fields(rest, "hold", SAMPLES), "hold.")
    asked = Problem(document, claims, (held or curve).times[-1])
    for T in (found.get("duration"), asked.top["duration"]):
        right = T == "auto" or abs(curve.t[-1] - ball(T, "duration")) <= TINY * curve.t[-1]
        need(right, f"duration: {curve.times[-1]} s", "refuted")
    need(curve.times[0] == 0, "times: expected the first to be 0", "refuted")
    index = number(found.get("goal_index") or Decimal(0), "goal_index")
    need(index in range(len(asked.goals)), "goal_index: expected that of a goal")
    asked.meet(curve, 0, "start", asked.top["start"])
    pairs = asked.meet(curve, -1, "goal", asked.goals[int(index)])
    sets = [(name, list(members.values())) for name, members in asked.sets.items()]
    pieces = prove(curve, sets + asked.bounds(curve), asked.edges)
    need((asked.hold > 0) == (held is not None), "hold: expected in both files, or in none")
    if held:
        joined = all(rest[key][0] == found[key][-1] for key in SAMPLES.split()[:3])
        late = abs(held.duration - ball(asked.hold, "hold")) > TINY * held.t[-1]
        need(joined and not late, "hold: expected from the last sample to its end", "refuted")
        kept = [smaller("roll", "rate", held.roll, pairs[0][0])] if len(pairs) == 1 else []
        for b, s in pairs:
            kept.append(smaller("hold", lambda p, b=b, s=s: p.pointing(b) - s(p.time, p.at), SMALL))
        pieces += prove(held, sets + asked.bounds(held) + kept, asked.edges)
    return f"{len(sets)} sets kept, {pieces} pieces"


def main() -> int:
    """Run the command; returns its exit code."""
    try:
        paths = [Path(x) for x in sys.argv[1:]]
        need(len(paths) == 2 and paths[0].suffix == paths[1].suffix, "expected PROBLEM PLAN")
        texts = [path.read_text("utf-8-sig") for path in paths]
    except (OSError, UnicodeDecodeError, Verdict) as error:
        print("bad", *error.args)
        return CODES["bad"]
    many = paths[0].suffix == ".jsonl"
    lines = [[x for x in t.split("\n") if x.strip()] if many else [t] for t in texts]
    codes = [0]
    for pair in zip_longest(*lines, fillvalue=""):
        try:
            word, why = "proven", examine(*pair)
        except Verdict as found:
            word, why = found.args
        print(word, why, flush=True)
        codes.append(CODES[word])
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
