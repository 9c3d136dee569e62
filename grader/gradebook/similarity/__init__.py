"""Which submissions of a class are alike, after renaming and reformatting."""
