"""The rules of a course: due dates, lateness, attempts, groups and extensions."""
