"""The voxel map: log-odds in bricks, updated by sweeps."""
