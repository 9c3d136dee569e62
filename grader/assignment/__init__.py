"""Assignments: YAML in, frozen typed models out."""
