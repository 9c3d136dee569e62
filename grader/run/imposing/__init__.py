"""Mistakes that a run imposes on a right program: only `rosgrade selftest` orders them."""
