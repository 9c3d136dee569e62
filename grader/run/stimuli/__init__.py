"""Stimuli: what the probe does in a run besides observing."""
