"""The one way this package compiles a kernel."""

import numba

# error_model="numpy" leaves division without a branch; nogil lets Python's own threads run kernels
# side by side. No fastmath: it would let the compiler reorder arithmetic, and two machines could
# then build two maps.
kernel = numba.njit(cache=True, error_model="numpy", nogil=True)

# A call costs some nanoseconds an argument: for what is called for each column, put in its place.
inlined = numba.njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
