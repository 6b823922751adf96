"""Shrinking of a failure: the smallest scenario that fails in the same way, for the same cause."""
