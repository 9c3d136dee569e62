"""The isolated place of one run: the probe, the simulator, and how a run ends."""
