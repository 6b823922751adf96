"""Checking a log's decisions by slow code that shares nothing with what made them but the map.

Nothing is taken from a decision that follows from the log's inputs and settings: the map is rebuilt
sweep by sweep, the margin comes from the config and the logged pose, and whether a decision was
late from the logged delay and the deadline. Then the body is swept along the committed path, cell
by cell of that very map; and the trajectory along it is checked to be one that the body can follow,
and that ends at rest.
"""

from wayproof.harness.replay.audit.moment import Moment, Violation
from wayproof.harness.replay.audit.run import CHECKS, Audit, audit
from wayproof.harness.replay.audit.volumes import Volumes, together

__all__ = ["CHECKS", "Audit", "Moment", "Violation", "Volumes", "audit", "together"]
