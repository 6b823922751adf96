"""Tools of maintainers: generated files of the repository, and counts over many logs."""
