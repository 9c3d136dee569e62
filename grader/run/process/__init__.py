"""The student's processes: their start, their output, their end."""
