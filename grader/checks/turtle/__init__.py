"""Turtles: what they draw, with which pen, who is caught; judged by the true simulation."""
