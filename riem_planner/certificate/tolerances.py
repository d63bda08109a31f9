# SPDX-License-Identifier: Apache-2.0
"""What a certificate still takes for rounding, or for what interpolation adds."""

import math

ATTITUDE_TOLERANCE = 1e-9
"""Error of the start and goal that is still rounding [rad]."""
RATE_TOLERANCE = 1e-9
"""Error of rates at the ends, in units of the slew: `T |dv| <= RATE_TOLERANCE (1 + T |v|)`."""
ROLL_TOLERANCE, LEAST_ROLL = 1e-6, 1e-9
"""Roll on S^2 at all times: the former per greatest rate of a sample, and the latter over T."""
HOLD_TOLERANCE = 1e-6
"""Of a hold's attitude [rad] and rate [rad/s]."""
NORM_TOLERANCE = 1e-9
"""Of a sample's quaternion."""
DURATION_TOLERANCE = 1e-9
"""Relative."""
JOIN_TOLERANCE = 1e-9
"""Mismatch of two quintics where they meet [rad]; of rates times h, of accelerations times h^2."""
JUMP_TOLERANCE = 0.1
"""Turn to the next sample that the rates leave unexplained, per greatest rate times h."""
HALF_TURN = 0.9 * math.pi
"""Samples further apart than this [rad] leave open which way round the attitude goes."""
