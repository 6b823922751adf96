"""Gates of a comparison for which none are given."""

DEFAULT_GATES = ("success.drop <= 0.1", "collisions.rise <= 0.1")
"""Default gates; held from about 50 unchanged pairs on."""
