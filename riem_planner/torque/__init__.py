# SPDX-License-Identifier: Apache-2.0
"""Torque instead of acceleration: the inertia metric as a second cost, on SO(3).

With the inertia J and its mean principal moment `J_m = trace(J) / 3`,

    1/2 int ( |u|^2 / J_m^2 + sigma |v|^2 + sum V_i ) dt,    u = J a + v x J v  [N m],

is the cost of `Problem` where J is a multiple of the identity. `u = J D^2R/dt^2`, the covariant
acceleration of the left-invariant metric that J gives. The variation of a curve by
`R exp(hat(eps xi))` is, exactly along eps,

    dv/deps = xi' + v x xi =: w,    da/deps = w',    so   d^2v/deps^2 = w x xi,

and with `p = J u / J_m^2` and `L_v = sigma v + (J v x u + J (u x v)) / J_m^2` the first
variation vanishes where, with `F = 1/2 grad sum V_i`,

    m' = m x v + F,    m = L_v - p'.

(The Euler-Poincare equation of second order. With `J = I` it is that of `riem_planner.extremals`.)
"""

from riem_planner.torque.extremality import torque_extremality
from riem_planner.torque.refine import TorqueSolution, refine_torque

__all__ = ["TorqueSolution", "refine_torque", "torque_extremality"]
