"""Open what a student handed in: a folder or an archive, within limits."""
