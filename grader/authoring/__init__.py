"""What an author of assignments works with."""
