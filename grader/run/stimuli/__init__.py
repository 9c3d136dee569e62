"""Stimuli: actions of the probe in a run."""
