"""Checks of turtles: what they draw and with which pen, who is spawned and caught."""
