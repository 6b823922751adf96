"""Gates of a comparison for which none are given."""

DEFAULT_GATES = (
    "success.drop <= 0.1",
    "collisions.rise <= 0.1",
    "least_clearance.drop <= 0.1",
    "not_admitted.rise <= 0.1",
    "time_to_goal.rise <= 2",
)
"""Default gates; those of figures that no pair has are left out.

The bounds of success and collisions are held from about 50 unchanged pairs on. Eight worlds show a
broken median of clearance, as of all five gates together the sign test needs a p of 0.01.
"""
