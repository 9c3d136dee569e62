"""A grade in words."""
