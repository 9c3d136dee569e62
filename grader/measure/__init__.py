"""What a recording shows, as numbers: no verdict, and no cause."""
