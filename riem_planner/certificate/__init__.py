# SPDX-License-Identifier: Apache-2.0
"""The checker: judges a published trajectory by itself and never trusts the solver.

It needs only the trajectory, the problem and its obstacles.
"""

from riem_planner.certificate.certify import Certificate, certify
from riem_planner.certificate.clearance import Clearance, certify_clearance, clearance_along
from riem_planner.certificate.limit_use import LimitUse, certify_limits

__all__ = [
    "Certificate",
    "Clearance",
    "LimitUse",
    "certify",
    "certify_clearance",
    "certify_limits",
    "clearance_along",
]
