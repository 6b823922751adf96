"""Replay, audit, verification and forks of logs."""
