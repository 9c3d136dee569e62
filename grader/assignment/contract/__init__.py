"""The contract of an assignment: what the ROS graph of a right submission looks like."""
