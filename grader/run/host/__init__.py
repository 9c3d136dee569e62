"""What the machine takes from a run: CPU time, memory, the clock."""
