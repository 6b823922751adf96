"""Decorators that compile the kernels of maps."""

import numba

# error_model="numpy" compiles a division without a branch for zero; nogil lets Python threads run
# kernels side by side. No fastmath: it would let the compiler reorder arithmetic, and two machines
# could then build two maps.
kernel = numba.njit(cache=True, error_model="numpy", nogil=True)

# A call costs some nanoseconds an argument; for kernels that are called for each column.
inlined = numba.njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
