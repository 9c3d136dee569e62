"""Pages for a browser on this machine: `review` and `watch`."""
