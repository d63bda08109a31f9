# SPDX-License-Identifier: Apache-2.0
"""The model for m4opt beside m4opt's own, where zones don't matter and where they do."""

import numpy as np
import pytest

from riem_planner import Limits
from riem_planner.surveys import ZoneArray

pytestmark = pytest.mark.extras

RATE, ACCELERATION, SETTLING = 0.6, 0.006, 60.0  # deg/s, deg/s^2, s


@pytest.fixture(scope="module")
def models():
    from astropy import units as u
    from m4opt.dynamics import EigenAxisSlew, Slew

    from riem_planner.m4opt import CertifiedSlew

    zones = ZoneArray(("sun",), [1, 0, 0], [[0, 0, 1]], [np.radians(30)])
    limits = Limits(rate=np.radians(RATE), acceleration=np.radians(ACCELERATION))
    mine = CertifiedSlew(zones, limits, SETTLING * u.s)
    assert isinstance(mine, Slew)
    theirs = EigenAxisSlew(
        RATE * u.deg / u.s, ACCELERATION * u.deg / u.s**2, settling_time=SETTLING * u.s
    )
    return mine, theirs


@pytest.fixture(scope="module")
def sky():
    from astropy import units as u
    from astropy.coordinates import SkyCoord

    rng = np.random.default_rng(8)
    ra, dec, roll = rng.uniform(0, 360, 40), rng.uniform(-80, 59, 40), rng.uniform(-180, 180, 40)
    return SkyCoord(ra * u.deg, dec * u.deg), roll * u.deg


def test_times_are_those_of_the_blind_model_or_longer(models, sky):
    from astropy import units as u

    mine, theirs = models
    centers, rolls = sky
    pairs = (centers[:, None], centers[None], rolls[:, None], rolls[None])
    certified, blind = mine.time(*pairs).to_value(u.s), theirs.time(*pairs).to_value(u.s)
    assert certified.shape == (40, 40)
    off = ~np.eye(40, dtype=bool)  # their arccos of a trace just above 3 is not a number
    equal = np.abs(certified - blind)[off] < 1e-6 * blind[off]
    assert 0.8 < equal.mean() < 1.0
    assert np.all(certified[off] > blind[off] * (1 - 1e-6))
    assert np.all(np.isfinite(certified))


def test_a_target_in_a_zone_takes_for_ever(models):
    from astropy import units as u
    from astropy.coordinates import SkyCoord

    mine, _ = models
    pole, equator = SkyCoord(0 * u.deg, 80 * u.deg), SkyCoord(0 * u.deg, 0 * u.deg)
    assert mine.time(equator, pole) == np.inf * u.s
    assert mine.time(equator, equator) == SETTLING * u.s


def test_frames_must_agree(models):
    from astropy import units as u
    from astropy.coordinates import SkyCoord

    mine, _ = models
    here = SkyCoord(0 * u.deg, 0 * u.deg)
    with pytest.raises(ValueError, match="frame"):
        mine.time(here, here.galactic)
