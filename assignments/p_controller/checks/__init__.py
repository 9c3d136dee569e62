"""Checks of this lesson alone: the law of a proportional controller."""
