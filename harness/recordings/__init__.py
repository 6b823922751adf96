"""Recordings of real robots, read from the formats of others and written to them.

A recording has sensors, a track of poses, and sweeps, which are read one by one.
"""
