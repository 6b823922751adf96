"""Logs: records and messages, written and read, and what can be saved of a broken file."""
