# SPDX-License-Identifier: Apache-2.0
"""The table of the integrator is SciPy's."""

import numpy as np
from scipy.integrate import DOP853

from riem_planner.solver import dop853


def test_the_coefficients_are_those_of_scipy():
    stages = dop853.STAGES
    assert stages == DOP853.n_stages
    assert np.array_equal(dop853.STAGE_WEIGHTS, DOP853.A[:stages, :stages])
    assert np.array_equal(dop853.WEIGHTS, DOP853.B)
    assert np.allclose(dop853.NODES, DOP853.C[:stages], rtol=0.0, atol=2e-15)
