"""Logs: writing, reading, copying and recovery."""
