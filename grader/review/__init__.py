"""What a person adds to a grade: manual points, comments, and mistakes that are forgiven."""
