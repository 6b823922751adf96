"""Simulations of the statistics: coverage of intervals, false alarms and power of gates."""
