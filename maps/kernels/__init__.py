"""Compiled kernels of the maps, by topic; kernels may call those of other files."""
