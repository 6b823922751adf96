"""Prior maps: evidence that the episode did not measure, read from files or made of a world."""
