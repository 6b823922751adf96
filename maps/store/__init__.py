"""Storage of cells: a pool of slots with a hash directory, eviction and a digest."""
