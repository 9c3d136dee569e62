"""This machine: its ROS installation, its load, its folders for caches and scratch files."""
