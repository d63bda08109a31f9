# SPDX-License-Identifier: Apache-2.0
"""Attitude Ephemeris Messages: CCSDS 504.0-B-1, keyword = value notation, version 1.0."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from riem_planner.riem_export.epochs import utc_text
from riem_planner.riem_export.knots import Flight, continuous, knots, seconds

_LINEAR = 100.0  # (this times the tolerance)^(1/3) rad: what linear quaternions may turn by


def aem_text(
    flight: Flight,
    epoch: datetime,
    created: datetime,
    *,
    name: str,
    identity: str,
    originator: str,
    tolerance: float,
) -> str:
    """Message of a flight.

    Parameters
    ----------
    epoch
        UTC of its begin.
    created
        UTC of the message.
    name, identity
        Of the spacecraft: OBJECT_NAME, OBJECT_ID.
    tolerance
        Greatest error between records [rad], of turns at a constant rate and of quaternions
        that are interpolated linearly and made unit.
    """
    ticks = knots(flight, tolerance, min(1.0, (_LINEAR * tolerance) ** (1.0 / 3.0)))
    q = continuous(flight.evaluate(seconds(ticks))[0])
    first, last = utc_text(epoch, 0), utc_text(epoch, int(ticks[-1]))
    lines = [
        "CCSDS_AEM_VERS = 1.0",
        f"CREATION_DATE = {created.strftime('%Y-%m-%dT%H:%M:%S')}",
        f"ORIGINATOR = {originator}",
        "META_START",
        "COMMENT v_A = R(q) v_B: the quaternion turns body components into those of EME2000",
        f"OBJECT_NAME = {name}",
        f"OBJECT_ID = {identity}",
        "REF_FRAME_A = EME2000",
        "REF_FRAME_B = SC_BODY_1",
        "ATTITUDE_DIR = A2B",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {first}",
        f"STOP_TIME = {last}",
        "ATTITUDE_TYPE = QUATERNION",
        "QUATERNION_TYPE = LAST",
        "META_STOP",
        "DATA_START",
    ]
    for tick, row in zip(ticks, q, strict=True):
        numbers = " ".join(np.format_float_positional(x, 16, unique=False) for x in row)
        lines.append(f"{utc_text(epoch, int(tick))} {numbers}")
    return "\n".join([*lines, "DATA_STOP", ""])
