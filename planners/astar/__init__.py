"""A* over a grid: positions on a coarse lattice, and places with headings where room is scarce."""
