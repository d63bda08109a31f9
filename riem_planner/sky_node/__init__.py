# SPDX-License-Identifier: Apache-2.0
"""The node that tells a planner where the bodies of the sky are, by its clock and an orbit."""
