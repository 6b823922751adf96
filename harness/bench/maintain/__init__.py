"""Files of the repository that are generated, and counts over many logs."""
