# SPDX-License-Identifier: Apache-2.0
"""UTC, with its leap seconds, and seconds that have none."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone

from riem_planner.errors import InvalidProblemError

# Days from which TAI - UTC has grown by a second each, from 10 s on 1 January 1972 (IERS).
_LEAPS = tuple(
    datetime.strptime(day, "%Y-%m-%d").replace(tzinfo=timezone.utc)
    for day in (
        "1972-01-01", "1972-07-01", "1973-01-01", "1974-01-01", "1975-01-01", "1976-01-01",
        "1977-01-01", "1978-01-01", "1979-01-01", "1980-01-01", "1981-07-01", "1982-07-01",
        "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01", "1992-07-01",
        "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01",
        "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01",
    )
)  # fmt: skip
_FIRST_OFFSET = 10  # s, TAI - UTC in 1972
_TT_MINUS_TAI = 32.184
_J2000 = datetime(2000, 1, 1, 12, tzinfo=timezone.utc)


def parse_epoch(text: str) -> datetime:
    """UTC of an ISO 8601 text; without an offset it is UTC.

    Raises
    ------
    InvalidProblemError
        It is no time of 1972 or later.
    """
    try:
        moment = datetime.fromisoformat(text.removesuffix("Z"))
    except ValueError:
        raise InvalidProblemError(
            "--epoch", f"expected a time such as 2030-01-31T12:00:00.000, got {text!r}"
        ) from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    moment = moment.astimezone(timezone.utc)
    if moment < _LEAPS[0]:
        raise InvalidProblemError("--epoch", f"expected 1972 or later, got {text!r}")
    return moment


def _offset(moment: datetime) -> int:
    """TAI - UTC [s]."""
    return _FIRST_OFFSET - 1 + sum(leap <= moment for leap in _LEAPS)


def tt_seconds(moment: datetime) -> float:
    """Terrestrial time of a UTC, in seconds past J2000."""
    return (moment - _J2000).total_seconds() + _offset(moment) + _TT_MINUS_TAI


def utc_text(epoch: datetime, microseconds: int) -> str:
    """UTC that many SI microseconds after an epoch, `YYYY-MM-DDThh:mm:ss.ffffff`."""
    moment = epoch + timedelta(microseconds=microseconds)
    before = _offset(epoch)
    late = _offset(moment) - before
    if late:
        moment -= timedelta(seconds=late)
        if _offset(moment) - before < late:
            # Inside the leap second, the 61st of its minute.
            shown = moment.strftime("%Y-%m-%dT%H:%M")
            return f"{shown}:60.{moment.microsecond:06d}"
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f")
