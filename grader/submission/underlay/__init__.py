"""Underlays: install spaces under the student's, of packages that are built once and kept."""
