"""What turtles did and drew, read from their truth."""
