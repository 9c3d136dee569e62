"""Running a submission: the only part of the grader that imports rclpy."""
