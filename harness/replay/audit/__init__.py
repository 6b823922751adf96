"""Audit of the decisions of a log, by simple code that shares only the map with the stack.

Everything that follows from inputs and settings is computed again: the map from the sweeps, the
margin from the config and the logged pose, lateness from the logged delay and the deadline. Then
the body is swept along the committed path, cell by cell of that map, and the trajectory is checked:
the body can follow it, and it ends at rest.
"""

from wayproof.harness.replay.audit.committed import Violation
from wayproof.harness.replay.audit.run import CHECKS, Audit, Auditor, audit
from wayproof.harness.replay.audit.volumes import Volumes, together

__all__ = ["CHECKS", "Audit", "Auditor", "Violation", "Volumes", "audit", "together"]
