# SPDX-License-Identifier: Apache-2.0
"""SPICE kernels: attitudes and rates as a CK of type 3, and the clock that its times are in."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np

from riem_planner.errors import InvalidProblemError
from riem_planner.riem_export.epochs import tt_seconds
from riem_planner.riem_export.knots import (
    Flight,
    continuous,
    knots,
    reference_rates,
    seconds,
)

CLOCK_SUFFIX = ".tsc"


def spacecraft_code(identity: str) -> int:
    """The NAIF code that an object id states.

    Raises
    ------
    InvalidProblemError
        It is not a negative integer.
    """
    try:
        code = int(identity)
    except ValueError:
        code = 0
    if not -999_999 <= code < 0:
        raise InvalidProblemError(
            "--object-id",
            f"expected the spacecraft's NAIF code, a negative integer such as -999, got"
            f" {identity!r}",
        )
    return code


def clock_kernel(code: int, epoch: datetime) -> str:
    """Text of a spacecraft clock kernel: microseconds from an epoch."""
    key = -code
    seconds = tt_seconds(epoch)
    return f"""KPL/SCLK

A clock of 1e6 ticks a second that begins at {epoch.strftime("%Y-%m-%dT%H:%M:%S.%f")} UTC.

\\begindata

SCLK_KERNEL_ID = ( @{epoch.strftime("%Y-%m-%dT%H:%M:%S")} )
SCLK_DATA_TYPE_{key} = ( 1 )
SCLK01_TIME_SYSTEM_{key} = ( 2 )
SCLK01_N_FIELDS_{key} = ( 2 )
SCLK01_MODULI_{key} = ( 4294967296 1000000 )
SCLK01_OFFSETS_{key} = ( 0 0 )
SCLK01_OUTPUT_DELIM_{key} = ( 1 )
SCLK_PARTITION_START_{key} = ( 0.0 )
SCLK_PARTITION_END_{key} = ( 4.294967295E15 )
SCLK01_COEFFICIENTS_{key} = ( 0.0 {seconds:.9f} 1.0 )

\\begintext
"""


def write_ck(
    flight: Flight, epoch: datetime, path: Path, *, name: str, identity: str, tolerance: float
) -> Path:
    """Write the CK of a flight and, beside it, its clock kernel; returns the latter's path.

    SPICE's quaternion is `(w, -x, -y, -z)` of ours, and its rates are in the reference frame.
    The attitude is that of the structure `1000 code`; between records it turns at a constant
    rate.
    """
    import spiceypy

    code = spacecraft_code(identity)
    clock = path.with_suffix(CLOCK_SUFFIX)
    clock.write_text(clock_kernel(code, epoch), encoding="ascii")
    ticks = knots(flight, tolerance)
    q, v, _ = flight.evaluate(seconds(ticks))
    q = continuous(q)
    encoded = ticks.astype(float)
    partial = path.with_name(path.name + ".partial")
    partial.unlink(missing_ok=True)
    handle = spiceypy.ckopn(str(partial), name[:60], 0)
    spiceypy.ckw03(
        handle, encoded[0], encoded[-1], 1000 * code, "J2000", True, name[:40], len(ticks), encoded,
        np.column_stack([q[:, 3], -q[:, :3]]), reference_rates(q, v), 1, encoded[:1],
    )  # fmt: skip
    spiceypy.ckcls(handle)
    partial.replace(path)
    return clock
