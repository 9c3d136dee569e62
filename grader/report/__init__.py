"""Reports: pure functions of a grade and its recordings; the same input gives the same bytes."""
