"""Checks of executors and timers."""
