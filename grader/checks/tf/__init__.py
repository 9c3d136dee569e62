"""Checks of transforms between frames, and of the tree that they make."""
