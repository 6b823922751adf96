"""Rival representations behind the interface of the voxel map."""
