"""Mutants: mistakes that the checks of an assignment must notice."""
