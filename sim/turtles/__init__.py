"""Turtles on a canvas, as ROS's turtlesim has them: a pure core, and a thin node."""
