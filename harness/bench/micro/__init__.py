"""Benchmarks of single stages: rays, maps, plans, the decision loop, the log."""
