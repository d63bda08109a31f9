# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft as a ROS node."""
