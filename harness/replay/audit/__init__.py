"""Audit of the decisions of a log, by simple code that shares only the map with the stack.

Three rules: a committed motion stays in space that its map admits; it comes to rest within the
body's limits; it begins where the last one is. Two exceptions: a forced stop along what was
admitted when it was chosen, or no nearer to what blocks that; and a slow way out of the inflation.

Everything that follows from inputs and settings is computed again: the map from the sweeps, the
margin from the config and the logged pose, lateness from the logged delay and the deadline. Then
the body is swept along the committed path, cell by cell of that map (`harness.judge`).
"""

from wayproof.harness.replay.audit.committed import Violation
from wayproof.harness.replay.audit.run import CHECKS, Audit, Auditor, audit

__all__ = ["CHECKS", "Audit", "Auditor", "Violation", "audit"]
