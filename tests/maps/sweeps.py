"""Sweeps of random beams, and those of scanners."""

import numpy as np


def unit_vectors(rng, count):
    """Random directions (count, 3)."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def scattered(rng, count, nearest_mm, farthest_mm):
    """Random directions (count, 3) and ranges, mm."""
    return unit_vectors(rng, count), rng.integers(nearest_mm, farthest_mm, count).astype(np.uint16)


def scan(elevations, azimuths):
    """Directions (rows x columns, 3) of a scanner, rad, row by row."""
    elevation, azimuth = np.meshgrid(elevations, azimuths, indexing="ij")
    flat = np.cos(elevation)
    rows = [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
    return np.stack(rows, axis=-1).reshape(-1, 3)


def floor_scan(height):
    """Directions of 32 rings from -45 to 15 degrees, and ranges to a floor up to 8 m, mm."""
    directions = scan(np.deg2rad(np.linspace(-45.0, 15.0, 32)), np.arange(250) * (np.pi / 125))
    with np.errstate(divide="ignore"):
        ranges = np.where(directions[:, 2] < 0.0, -height / directions[:, 2], np.inf)
    return directions, np.where(ranges > 8.0, 65535, np.round(1000.0 * ranges)).astype(np.uint16)


def random_sweep(rng, count, reach_mm):
    directions = rng.normal(size=(count, 3))
    directions[::7] = np.eye(3)[rng.integers(0, 3, len(directions[::7]))]
    directions[3::7] = rng.choice([-1.0, 1.0], (len(directions[3::7]), 3)) * [1.0, 1.0, 0.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(1, reach_mm, count).astype(np.uint16)
    ranges_mm[::5] = 65535
    ranges_mm[::11] = 0
    return directions, ranges_mm
