"""Beams straight from their definition in `maps.kernels.beams`: slow walks, cell by cell."""

from fractions import Fraction

HALVES = 1024
WHOLE = 2**40


def from_middle(sensor, end):
    """The vector from the middle of the end cell to the sensor, in 1/1024 of a cell."""
    return [q - (HALVES * c + HALVES // 2) for q, c in zip(sensor, end, strict=True)]


def naive_cells(sensor, end, returned, guard):
    """The cells that a beam crosses, from its end cell to the sensor (in 1/1024 of a cell).

    The guard "own": beams from above that return spare the layer that they end in; true: layer 0.
    """
    cell = [q // HALVES for q in sensor]
    to_sensor = from_middle(sensor, end)
    faces = []
    for axis in range(2):
        half = 2**49 // abs(to_sensor[axis])
        for k in range(abs(cell[axis] - end[axis])):
            faces.append(((2 * k + 1) * half, axis))
    x, y, z = end
    crossed = set()
    for fraction, axis in [*sorted(faces), (None, None)]:
        leave = cell[2]
        if fraction is not None:
            middle = HALVES * end[2] + HALVES // 2
            leave = int((middle + Fraction(fraction, WHOLE) * to_sensor[2]) // HALVES)
        crossed |= {(x, y, height) for height in range(min(z, leave), max(z, leave) + 1)}
        z = leave
        x += (axis == 0) * (1 if to_sensor[0] > 0 else -1)
        y += (axis == 1) * (1 if to_sensor[1] > 0 else -1)
    if guard and returned and end[2] < cell[2] and (guard == "own" or end[2] == 0):
        crossed = {c for c in crossed if c[2] != end[2]}
    return crossed
