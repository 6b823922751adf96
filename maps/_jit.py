"""The one way this package compiles a kernel."""

import numba

# error_model="numpy" leaves division without a branch; no fastmath, because it would let the
# compiler reorder arithmetic and two machines could then build two maps.
kernel = numba.njit(cache=True, error_model="numpy", nogil=True)
