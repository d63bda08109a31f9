"""The planner's ROS face: messages become calls of `riem_planner.mission`, its results messages."""
