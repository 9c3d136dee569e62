"""Grading submissions, one or many."""
