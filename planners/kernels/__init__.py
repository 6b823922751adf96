"""Compiled kernels of the planners, a file for each topic."""
