# SPDX-License-Identifier: Apache-2.0
"""Initial-value problems to rounding: extremals of every space are followed by one integrator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import positive_number
from riem_planner.errors import RiemPlannerError

Array = NDArray[np.float64]

TOLERANCE = 1e-13
"""Of each step, absolute; as near to rounding as the integrator gets."""
_MOST_EVALUATIONS = 20_000  # of the field; towards a singularity the steps shrink without end


class ExtremalEndsError(RiemPlannerError):
    """The extremal could not be continued to the duration asked for.

    Parameters
    ----------
    time
        The last time it was followed to [s].
    duration
        The duration asked for [s].
    """

    def __init__(self, time: float, duration: float) -> None:
        self.time = time
        super().__init__(
            f"the extremal ends at t = {time:.9g} s of {duration:.9g} s: it leaves every bound"
            " there, or meets an obstacle; shorten the duration or change the initial values"
        )


def integrate(
    field: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    tolerance: float = TOLERANCE,
    step: float | None = None,
) -> Callable[[Array], Array]:
    """Dense solution of `y' = field(t, y)` on [0, duration] by DOP853.

    Raises
    ------
    ExtremalEndsError
        The solution could not be continued to the end.
    """
    from scipy.integrate import solve_ivp  # slow to load, and not needed to solve

    options: dict[str, float] = {"rtol": max(tolerance, 3e-14), "atol": tolerance}
    if step is not None:
        h = positive_number("step", step)
        # A tolerance that nothing exceeds leaves the largest step as the only bound.
        options = {"rtol": 1e-3, "atol": 1e30, "first_step": h, "max_step": h}
    evaluations = 0

    def counted(t: float, y: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        if evaluations > _MOST_EVALUATIONS:
            raise ExtremalEndsError(t, duration)
        return field(t, y)

    with np.errstate(all="ignore"):  # overflow is what the end of an extremal looks like
        result = solve_ivp(
            counted, (0.0, duration), start, method="DOP853", dense_output=True, **options
        )
    if result.status != 0 or not np.all(np.isfinite(result.y[:, -1])):
        raise ExtremalEndsError(float(result.t[-1]), duration)
    return result.sol  # type: ignore[no-any-return]
