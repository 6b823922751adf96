"""Benchmarks and tools of the maintainers.

A benchmark is a file, and a line of `stages.STAGES`.
"""
