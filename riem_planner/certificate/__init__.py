"""The checker: judges a published trajectory by itself and never trusts the solver.

It needs only the trajectory, the problem and its obstacles.
"""

from riem_planner.certificate.certify import Certificate, certify
from riem_planner.certificate.clearance import Clearance, certify_clearance, clearance_along

__all__ = ["Certificate", "Clearance", "certify", "certify_clearance", "clearance_along"]
