# SPDX-License-Identifier: Apache-2.0
"""The least duration of a slew within limits.

With `s = t / T` the problem on [0, 1] has the tension `sigma T^2` and the strengths `tau T^4`
(mathematics, section 3). From rest to rest, with these normalised values given and nothing that
moves, the path is therefore the same for every duration: its rate and momentum go with 1/T, its
acceleration and torque with 1/T^2, and one solve tells the least T.

Otherwise the path changes with T. The durations are then searched from well below the estimate
upwards, in steps of at most 15 %, each solved anew from the last one's trajectory, and the first
step from broken limits to kept ones is halved until it is known to `TOLERANCE`. A window of
durations narrower than a step can be missed. Where a class of paths turns up that keeps the limits
with room to spare, it is followed to shorter durations, at which others are cheaper.

The search ends without an answer past a thousand times where it began, or where nothing at all is
found any more: with strengths of their own, obstacles push as hard however long a slew takes.
"""

from riem_planner.duration.least import (
    advised,
    broken_at_ends,
    least_duration,
    nothing_to_do,
    solve_auto,
)
from riem_planner.duration.search import LeastDuration, Solve

__all__ = [
    "LeastDuration",
    "Solve",
    "advised",
    "broken_at_ends",
    "least_duration",
    "nothing_to_do",
    "solve_auto",
]
