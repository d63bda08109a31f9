# SPDX-License-Identifier: Apache-2.0
"""Geometry of the spaces: exponential, logarithm, distance, Jacobians."""
