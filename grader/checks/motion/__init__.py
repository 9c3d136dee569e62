"""Checks of the true motion of a simulated robot."""
