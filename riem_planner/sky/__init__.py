# SPDX-License-Identifier: Apache-2.0
"""The sky as a spacecraft sees it: where the Sun, the Earth's limb, a star or a site is, and when.

Everything is in the GCRS (axes of the ICRF, origin at the Earth's centre). The direction of a body
is the apparent one: retarded by the light's way and aberrated by the spacecraft's velocity; the
Earth, its sites and other satellites are where they are (geometric). SGP4 gives positions in the
frame TEME of date, which is turned into the GCRS.

Skyfield and the ephemeris DE421 do the work, offline: `pip install 'riem_planner[sky]'`. They are
imported where they are used; nothing else of the package needs them.
"""

from riem_planner.sky.bodies import BODIES, Body, Fixed, Satellite, Site, Star
from riem_planner.sky.orbits import Circular, Inertial, Orbit, Tle
from riem_planner.sky.view import Limb, Sky

__all__ = [
    "BODIES",
    "Body",
    "Circular",
    "Fixed",
    "Inertial",
    "Limb",
    "Orbit",
    "Satellite",
    "Site",
    "Sky",
    "Star",
    "Tle",
]
