"""What the workers of one run of the tests have in common."""

import contextlib
import fcntl


@contextlib.contextmanager
def alone(path):
    """Be the only process in the block; a process that dies lets the next one in."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def checked_kernels(common):
    """What makes a process compile kernels with bounds checks; those that others compiled are kept.

    They are not optimised: it takes a third of the time, and changes no bit of a result.
    """
    folder = common / "checked"
    with alone(common / "checked.lock"):
        yield {"NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "0", "NUMBA_CACHE_DIR": str(folder)}
