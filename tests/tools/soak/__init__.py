"""Soak tests of the guarantees of logs, replays and studies.

Run by `python -m tests.tools.soak`.
"""
