"""Planning without ROS: problem files, plan files, the `riem_plan` command, plots."""
