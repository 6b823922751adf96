"""Compilation options of the kernels of this package."""

import numba

# No fastmath: a float sum must not change its order from one machine to the next.
kernel = numba.njit(cache=True, error_model="numpy", nogil=True)
