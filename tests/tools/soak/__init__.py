"""Soak tests of the guarantees of logs, replays and imports.

Run by `python -m tests.tools.soak`.
"""
