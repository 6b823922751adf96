"""Tables of a log as Arrow: decisions, truth, poses, sweeps; trajectory files for evo."""
