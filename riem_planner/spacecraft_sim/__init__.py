"""The simulated spacecraft as a ROS node."""
