# SPDX-License-Identifier: Apache-2.0
"""Least time within limits, clear of zones: `objective="least_time"`.

Minimise T over curves (R, v) on [0, T] with `R' = R hat(v)`, `a = v'` and given ends, such that
every stated limit and every zone is kept at all times. Strengths, ranges and tension play no part.

Level (a), `retiming`: the quickest motion along a given path, in a millisecond or two. Level (b),
`free_path`: direct transcription on the grid of the plan's samples, with attitude, rate and
acceleration at the nodes and the duration a variable, solved by a primal-dual interior point whose
Newton steps are a Riccati recursion; from paths of several classes on few nodes, and from the best
of them on the samples. Classes are enumerated, not proven complete: the result is the least
duration *found*, beside a lower bound of any (`bound`).

A sharp switch of acceleration is a ramp of one interval here, so that what is published is what
was optimised. What the quintics between the samples add to the limits is taken back by tightening
them or, where the path stays the same, by slowing down; the certificate judges the result.
"""

from riem_planner.least_time.bound import least_possible_duration
from riem_planner.least_time.solving import SAMPLES, LeastTime

__all__ = ["SAMPLES", "LeastTime", "least_possible_duration"]
