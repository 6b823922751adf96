"""Compiled kernels; those that call each other stand in one file."""
