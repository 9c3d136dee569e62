"""Build packages with colcon, and keep what was built."""
