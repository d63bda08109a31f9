# SPDX-License-Identifier: Apache-2.0
"""The libraries and data of the sky, loaded once, offline; and time."""

from __future__ import annotations

import warnings
from datetime import datetime
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError

Array = NDArray[np.float64]

EXAMPLE = "2027-03-01T06:00:00Z"
YEARS = (1900, 2053)
"""First and last year of the ephemeris."""


@cache
def ephemeris() -> Any:
    """The segments of DE421, by name.

    Raises
    ------
    InvalidProblemError
        The libraries are not installed.
    """
    try:
        from skyfield.api import Loader
        from skyfield_data import get_skyfield_data_path
    except ImportError as error:
        raise InvalidProblemError(
            "epoch", f"needs {error.name}, which is not installed: pip install 'riem_planner[sky]'"
        ) from None
    with warnings.catch_warnings():
        # Of files with the Earth's future rotation, which nothing here reads.
        warnings.simplefilter("ignore")
        folder = get_skyfield_data_path()
    return Loader(folder, verbose=False)("de421.bsp")


@cache
def timescale() -> Any:
    """Leap seconds and the Earth's rotation, as they came with the library."""
    ephemeris()  # so that what is missing is told the same way
    from skyfield.api import load

    return load.timescale(builtin=True)


def parsed_epoch(text: Any) -> datetime:
    """Time of a text such as 2027-03-01T06:00:00Z.

    Raises
    ------
    InvalidProblemError
        It is no time, not of UTC, or outside the ephemeris.
    """
    moment = text if isinstance(text, datetime) else None
    if isinstance(text, str):
        try:
            moment = datetime.fromisoformat(text.replace("Z", "+00:00"))
        except ValueError:
            moment = None
    if moment is None or moment.tzinfo is None:
        raise InvalidProblemError(
            "epoch", f"expected UTC that ends in Z or an offset ({EXAMPLE}), got {text!r}"
        )
    if not YEARS[0] <= moment.year < YEARS[1]:
        raise InvalidProblemError(
            "epoch",
            f"{moment.year} is outside the ephemeris ({YEARS[0]} to {YEARS[1]}); choose another",
        )
    return moment


def times_after(epoch: datetime, seconds: Array) -> Any:
    """Times of the library, seconds (n,) after an epoch."""
    scale = timescale()
    begin = scale.from_datetime(epoch)
    return scale.tt_jd(begin.whole, begin.tt_fraction + seconds / 86400.0)
