"""What a certificate still takes for rounding, or for what interpolation adds."""

import math

ATTITUDE_TOLERANCE = 1e-6
"""Error of the start and goal that is still rounding [rad]."""
RATE_TOLERANCE = 1e-6
"""Error of rates at the ends, times `1 + |v|` [rad/s]; on S^2 also of roll at the samples."""
ROLL_TOLERANCE = 1e-3
"""Roll between samples on S^2, per greatest rate: what interpolation may add."""
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
