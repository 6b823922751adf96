"""Files of the map of a decision, for other tools: Nav2, OctoMap, PCD, PLY, and our own."""
