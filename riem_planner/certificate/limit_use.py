"""How much of a spacecraft's limits a trajectory uses, in continuous time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from riem_planner.certificate.limit_bounds import bound_limits
from riem_planner.limits import QUANTITIES, UNITS, Limits

if TYPE_CHECKING:
    from riem_planner.trajectory import Trajectory


@dataclass(frozen=True)
class LimitUse:
    """Parts of the limits that a trajectory uses, certified in continuous time.

    Parameters
    ----------
    parts
        Upper bound of the part used at the worst, per limited quantity; above 1 it is broken.
    worst
        Time [s] of the greatest part found, per limited quantity.
    reasons
        Which limits are broken, by how much and when; empty when none is.
    """

    parts: dict[str, float] = field(default_factory=dict)
    worst: dict[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()


def certify_limits(trajectory: Trajectory, limits: Limits | None) -> LimitUse:
    """Bound the part of each limit that a trajectory uses; none without limits."""
    if limits is None:
        return LimitUse()
    result = bound_limits(
        trajectory.times,
        trajectory.coefficients,
        limits.inertia_matrix,
        limits.largest_moment,
        limits.reciprocals,
    ).tolist()
    use = LimitUse()
    reasons = []
    for key, unit, (part, _, time) in zip(QUANTITIES, UNITS, result, strict=True):
        limit = getattr(limits, key)
        if limit is None:
            continue
        use.parts[key], use.worst[key] = part, time
        if not part <= 1.0:
            if isinstance(limit, float):
                stated = f"{limit:.6g} {unit}"
            else:
                stated = f"[{', '.join(f'{each:.6g}' for each in limit)}] {unit} per axis"
            reasons.append(
                f"limits.{key}: {part:.4g} times the limit of {stated} at t = {time:.6g} s"
            )
    return LimitUse(use.parts, use.worst, tuple(reasons))
