# SPDX-License-Identifier: Apache-2.0
"""What is limited, and the rows of every table of limits; compiled code reads them too."""

from __future__ import annotations

QUANTITIES = ("rate", "acceleration", "torque", "momentum", "jerk", "torque_rate")
"""What is limited by one number or three."""

UNITS = ("rad/s", "rad/s^2", "N m", "N m s", "rad/s^3", "N m/s")

WHEELS = "wheels"
"""The key of the reaction wheels, whose torque and momentum are limited one by one."""

RATE, ACCELERATION, TORQUE, MOMENTUM, JERK, TORQUE_RATE, WHEEL_TORQUE, WHEEL_MOMENTUM = range(8)
"""Rows of every table of limits: the quantities above, then what the wheels have to give."""

POWERS = (1.0, 2.0, 2.0, 1.0, 3.0, 3.0, 2.0, 1.0)
"""Of 1/T, with which each row's quantity goes along the same path."""

KEYS = (*QUANTITIES, WHEELS, WHEELS)
"""The key of each row's limit."""
