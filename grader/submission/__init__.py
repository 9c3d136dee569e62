"""Find what a student handed in, read it without running it, build it with colcon.

:func:`grader.submission.prepare.prepare` is the way in; what it finds out are the plain facts
of :mod:`grader.recording.submission`, which travel inside every recording.
"""
