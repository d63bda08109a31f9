# SPDX-License-Identifier: Apache-2.0
"""A slew model for the scheduler m4opt that knows the zones of one epoch.

Importing this module needs m4opt and astropy, which the package does not install.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u
from m4opt.dynamics import Slew
from numpy.typing import NDArray

from riem_planner.limits import Limits
from riem_planner.surveys import ZoneArray, celestial_attitudes, slew_times

Array = NDArray[np.float64]


class CertifiedSlew(Slew):  # type: ignore[misc]
    """Least times of slews that are certified clear of zones; infinite where there is none.

    Parameters
    ----------
    zones
        Of one epoch, in the axes of the coordinates that `time` is given (ICRS, say). The
        boresight is body x.
    limits
        What the spacecraft can do.
    settling_time
        Added to every slew: a time quantity, or seconds.
    jobs
        Threads.
    """

    def __init__(
        self, zones: ZoneArray, limits: Limits, settling_time: Any = 0.0, *, jobs: int = 1
    ) -> None:
        self.zones = zones
        self.limits = limits
        self.settling_time = u.Quantity(settling_time, u.s)
        self.jobs = jobs

    def time(
        self, center1: Any, center2: Any, roll1: Any = 0 * u.rad, roll2: Any = 0 * u.rad
    ) -> Any:
        """Times of slews, settling included, as a quantity of the broadcast shape.

        Parameters
        ----------
        center1, center2 : SkyCoord
            Where the boresight points before and after, in one frame.
        roll1, roll2
            Angles about it.
        """
        if not center1.is_equivalent_frame(center2):
            raise ValueError("center1 and center2 must be in one frame; transform one of them")
        settled = slew_times(
            attitude(center1, roll1),
            attitude(center2, roll2),
            zones=self.zones,
            limits=self.limits,
            settling_time=float(self.settling_time.to_value(u.s)),
            jobs=self.jobs,
        ).settled
        return settled * u.s


def attitude(center: Any, roll: Any) -> Array:
    """Quaternions (..., 4) of coordinates and rolls."""
    return celestial_attitudes(
        center.spherical.lon.to_value(u.rad),
        center.spherical.lat.to_value(u.rad),
        u.Quantity(roll).to_value(u.rad),
    )
