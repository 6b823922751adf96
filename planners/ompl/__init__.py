"""Search with OMPL: its planners, state spaces and validity checks over a free space."""
