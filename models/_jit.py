"""The numba decorator of this package.

Kernels that call each other live in one file: numba's cache does not notice when a callee in
another file changes. `error_model="numpy"` keeps divisions free of exception branches; there is
no `fastmath`, because results have to be the same bits on every run.
"""

import numba

kernel = numba.njit(cache=True, error_model="numpy", nogil=True)
