"""Benchmarks of whole episodes and whole studies."""
