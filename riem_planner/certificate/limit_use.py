# SPDX-License-Identifier: Apache-2.0
"""How much of a spacecraft's limits a trajectory uses, in continuous time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from riem_planner.certificate.limit_bounds import bound_limits
from riem_planner.limit_rows import KEYS, POWERS, QUANTITIES, UNITS, WHEEL_TORQUE, WHEELS
from riem_planner.limits import Limits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from riem_planner.trajectory import Trajectory

_AT_REST = np.zeros(3)


@dataclass(frozen=True)
class LimitUse:
    """Parts of the limits that a trajectory uses, certified in continuous time.

    Parameters
    ----------
    parts
        Upper bound of the part used at the worst, per limit's key; above 1 it is broken.
    worst_times
        Time [s] of the greatest part found, per limit's key.
    reasons
        Which limits are broken, by how much and when; empty when none is.
    stretch
        How many times slower the same path would keep the limits, where the total angular
        momentum is zero; 0 without limits.
    binding
        Key of the limit that says so.
    """

    parts: dict[str, float] = field(default_factory=dict)
    worst_times: dict[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    stretch: float = 0.0
    binding: str = ""


def certify_limits(
    trajectory: Trajectory,
    limits: Limits | None,
    total_momentum: NDArray[np.float64] = _AT_REST,
) -> LimitUse:
    """Bound the part of each limit that a trajectory uses; none without limits.

    Parameters
    ----------
    trajectory
        What is judged.
    limits
        What it is to keep.
    total_momentum : (3,)
        Of body and wheels, in the reference frame [N m s]; only wheels' limits depend on it.
    """
    if limits is None:
        return LimitUse()
    result = bound_limits(
        trajectory.times,
        (trajectory.quaternions_xyzw, trajectory.coefficients),
        (limits.inertia_matrix, limits.largest_moment, total_momentum),
        tuple(limits.table),
    ).tolist()
    parts: dict[str, float] = {}
    worst: dict[str, float] = {}
    reasons = []
    stretch, binding = 0.0, ""
    for row, (part, _, time) in enumerate(result):
        key = KEYS[row]
        if key not in limits.keys:
            continue
        factor = part ** (1.0 / POWERS[row])
        if not factor <= stretch:
            stretch, binding = factor, key
        if not part <= parts.get(key, -math.inf):
            parts[key], worst[key] = part, time
        if not part <= 1.0:
            reasons.append(
                f"limits.{key}: {part:.4g} times the limit of {_stated(limits, row)} at"
                f" t = {time:.6g} s"
            )
    return LimitUse(parts, worst, tuple(reasons), stretch, binding)


def _stated(limits: Limits, row: int) -> str:
    if KEYS[row] == WHEELS:
        return f"a wheel's {'torque' if row == WHEEL_TORQUE else 'momentum'}"
    limit: Any = getattr(limits, QUANTITIES[row])
    if isinstance(limit, float):
        return f"{limit:.6g} {UNITS[row]}"
    return f"[{', '.join(f'{each:.6g}' for each in limit)}] {UNITS[row]} per axis"
