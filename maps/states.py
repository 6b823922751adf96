"""The three states of a cell."""

UNKNOWN = 0
FREE = 1
OCCUPIED = 2

STATE_NAMES = {UNKNOWN: "unknown", FREE: "free", OCCUPIED: "occupied"}
