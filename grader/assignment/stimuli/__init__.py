"""Stimuli: their models, their messages and requests, and what must fit in them."""
