"""Read a package's files without running them."""
