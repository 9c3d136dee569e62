"""Checks of conversions between ways to write a rotation."""
