"""Visualization of logs in Rerun, Foxglove and image files."""
