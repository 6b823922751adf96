"""The one decision about how kernels of this package are compiled."""

import numba

# No fastmath: a float sum must not change its order from one machine to the next.
kernel = numba.njit(cache=True, error_model="numpy", nogil=True)
