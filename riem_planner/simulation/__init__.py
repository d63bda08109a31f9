"""A rigid spacecraft with wheels and controller, and flights of trajectories with it. No ROS."""
