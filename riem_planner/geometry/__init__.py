"""Geometry of the spaces: exponential, logarithm, distance, Jacobians."""
