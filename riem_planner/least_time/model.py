# SPDX-License-Identifier: Apache-2.0
"""The transcribed problem and its iterates, as arrays that compiled code reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CODE, POWER, ROW, ROWS, FIRST = range(5)
"""Columns of `Model.slots`."""

KIND, MEMBER, MEMBERS, CONSTRAINT = range(4)
"""Columns of `Model.sets`."""

ATTITUDE, OUT, IN = range(3)
"""Kinds of forbidden sets: about an attitude, in a cone, outside cones."""

MIDDLE = 8
"""Added to a quantity's row of a table of limits: half-way to the next node."""

D, V, A, P, U, STATE, STAGE = 0, 3, 6, 9, 10, 10, 13
"""Where the variables of a stage begin, and how many a state and a stage have."""


class Model(NamedTuple):
    """A problem of least time on N intervals, in the solver's body axes and normalised time.

    Attributes
    ----------
    slots : (n, 5)
        A limited quantity each: its row of the table of limits (plus `MIDDLE`), its power of 1/T,
        its first row and their number (0: a norm), and its first constraint.
    gains : (n,)
        Reciprocals of limits of norms, times `T_0^-power`.
    rows : (m, 3)
        As those of the table of limits, times `T_0^-power`.
    inertia : (3, 3)
        J [kg m^2].
    momentum : (3,)
        The total one in the reference frame, times T_0.
    power
        m of `p = (T/T_0)^m`.
    sets : (k, 4)
        A forbidden set each: its kind, first member, their number, and its constraint.
    place, drift : (l, N + 1, 4)
        Of each member at the nodes' times for `T = T_0`: quaternion, or direction and 0; and the
        derivative by `T/T_0`.
    level : (l, N + 1)
        Cosine of the radius, with a margin (of an attitude, the square of half of it); 2 where a
        member does not count.
    boresight : (l, 3)
        Body axis of a cone.
    ends : (2, 3)
        Rates at start and goal, times T_0; at a goal that is pointed at in the
        reference frame.
    smooth
        Whether accelerations are 0 at both ends.
    pointing
        Whether only the first body axis has to meet the goal.
    rolling
        Whether it may turn about that axis on the way.
    goal : (4,)
        Quaternion, or direction and 0.
    weight
        Of `|U|^2 N / 2` beside p: what makes the solution unique where the limits do not.
    """

    slots: NDArray[np.int64]
    gains: Array
    rows: Array
    inertia: Array
    momentum: Array
    power: float
    sets: NDArray[np.int64]
    place: Array
    drift: Array
    level: Array
    boresight: Array
    ends: Array
    smooth: bool
    pointing: bool
    rolling: bool
    goal: Array
    weight: float


class Iterate(NamedTuple):
    """Primal and dual variables; all are changed in place.

    Attributes
    ----------
    q : (N + 1, 4)
        Attitudes at the nodes.
    V, A : (N + 1, 3)
        Rates times T, accelerations times T^2.
    p : (1,)
        The duration's variable.
    s, z : (N + 1, c)
        Slacks and multipliers of the constraints `c + s = 0`.
    costates : (N + 1, 3)
        Multipliers of the attitudes' steps.
    """

    q: Array
    V: Array
    A: Array
    p: Array
    s: Array
    z: Array
    costates: Array


class Linear(NamedTuple):
    """Values and derivatives along an iterate.

    Attributes
    ----------
    f, by_tau : (N + 1, n, 3)
        Limited quantities, and their direct derivatives by T/T_0.
    by_stage : (N + 1, n, 3, 13)
        Their derivatives by the variables of a stage.
    c : (N + 1, c)
        Constraints, at most 0 where they hold.
    set_by_d, set_by_dd, set_by_tau : (N + 1, k, 3), (N + 1, k, 3, 3), (N + 1, k)
        Derivatives of the forbidden sets' constraints.
    defect : (N, 3)
        `log(q_+^-1 q exp(theta))`, 0 along a solution.
    back : (N, 3, 3)
        `exp(-theta)`.
    by_motion : (N, 3, 9)
        Derivatives of the step's end by V, A and U.
    """

    f: Array
    by_tau: Array
    by_stage: Array
    c: Array
    set_by_d: Array
    set_by_dd: Array
    set_by_tau: Array
    defect: Array
    back: Array
    by_motion: Array


class Riccati(NamedTuple):
    """The value of going on from a stage, `x P x / 2 + x (R_0 + R_1: nu)`, and the way there.

    Attributes
    ----------
    P, R : (10, 10), (10, 1 + n)
        At the stage reached; n end conditions with multipliers nu.
    gains : (N, 3, 11 + n)
        `U = gains (x, 1, nu)`.
    state_rows, end_rows : (N + 1, 3, 10), (N + 1, 3, 1 + n)
        First rows of P and R at each stage, which give the costates.
    M, m : (n, n), (n,)
        Curvature and slope of the value in nu.
    """

    P: Array
    R: Array
    gains: Array
    state_rows: Array
    end_rows: Array
    M: Array
    m: Array


class Step(NamedTuple):
    """A step of Newton's method: states, controls, slacks, multipliers, new costates."""

    x: Array
    u: Array
    s: Array
    z: Array
    costates: Array
