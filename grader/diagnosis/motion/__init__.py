"""Causes in the way that a robot took."""
