# SPDX-License-Identifier: Apache-2.0
"""A rigid spacecraft with wheels and controller, and flights of trajectories with it. No ROS."""
