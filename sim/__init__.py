"""The simulator: a world, a robot, a LiDAR and odometry, deterministic and without ROS.

Only :mod:`sim.node`, :mod:`sim.publishers` and :mod:`sim.live` import rclpy, and no other module
here imports them. Reading a world needs no numpy.
"""
