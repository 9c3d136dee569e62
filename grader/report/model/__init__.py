"""A grade as data: what every format is made from."""
