"""The true motion of a simulated robot, and the commands that it was given."""
