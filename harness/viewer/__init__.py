"""Logs as pictures: what Rerun, Foxglove and image files show is worked out here."""
