"""Manoeuvres of the stack: each returns a decision where it applies, and None elsewhere."""
