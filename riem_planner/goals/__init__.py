# SPDX-License-Identifier: Apache-2.0
"""Goals: where a slew arrives, with what rate, and how the attitude goes on from there.

Every goal tells the attitude and body rate of an arrival at time T (`arrival`), the body axis b
about which that attitude may be turned (`roll_axis`, None where it is determined), and how a hold
tracks it (`tracked`). At a free end the first variation of the cost is `v' . dv + m . eta` with
`m = sigma v - v''` and the body displacement eta; where R b = d and the rate is prescribed in the
reference frame, a roll changes the body rate too, and what is left of it is the condition

    b . (m + v' x v) = 0                                                (transversality).
"""

from riem_planner.goals.kinds import AttitudeGoal, Goal, PointingGoal
from riem_planner.goals.state import State, horizontal_rate

__all__ = ["AttitudeGoal", "Goal", "PointingGoal", "State", "horizontal_rate"]
