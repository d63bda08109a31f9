# SPDX-License-Identifier: Apache-2.0
"""Slews of whole surveys: a scheduler's matrix of least times that knows the zones.

Most pairs are answered in closed form: whether the slew about the eigenaxis is clear (`screen`),
how long it takes (`profiles`), a detour on a small circle (`arcs`), and whether zones part the
ends (`walls`). What is left goes to the general planner.
"""

from riem_planner.surveys.matrix import SlewTimes, slew_times
from riem_planner.surveys.pointings import celestial_attitudes, pointings
from riem_planner.surveys.slew import Slew
from riem_planner.surveys.verdicts import SlewVerdict
from riem_planner.surveys.zone_array import ZoneArray

__all__ = [
    "Slew",
    "SlewTimes",
    "SlewVerdict",
    "ZoneArray",
    "celestial_attitudes",
    "pointings",
    "slew_times",
]
