"""Gates of a comparison of two studies that names none."""

DEFAULT_GATES = ("success.drop <= 0.1", "collisions.rise <= 0.1")
"""Held from about 50 pairs on in which nothing changed."""
