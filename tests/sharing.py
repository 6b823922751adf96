"""What the workers of one run of the tests have in common."""

import contextlib
import fcntl


@contextlib.contextmanager
def alone(path):
    """Be the only process in the block; a process that dies lets the next one in."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
