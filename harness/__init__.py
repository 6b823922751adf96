"""Scenario, episode loop, decision, log, replay and command line."""

import os

# Small products on two BLAS threads are slower than on one, and their order of summation varies.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
