"""What a user sees while a command runs: the terminal, and pages in a browser."""
