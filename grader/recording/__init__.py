"""Everything observed in one run, and its MCAP file."""
