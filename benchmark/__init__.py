# SPDX-License-Identifier: Apache-2.0
"""Measurements of the planner beside its peers; run by `make bench` as `python -m benchmark`."""

import os

# One thread for everyone. It must be said before NumPy, SciPy and IPOPT are loaded.
for _variable in (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
):
    os.environ[_variable] = "1"
