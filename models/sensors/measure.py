"""Measurement: reports of a device from true distances."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating
from wayproof.models.sensors.beams import DROPPED, MILLIMETRES, NO_RETURN
from wayproof.models.sensors.devices.device import Device, RangeNoise

NONE_LOST = np.zeros(0, np.bool_)


def measure(
    device: Device,
    distance: NDArray[np.float64],
    incidence_cosine: NDArray[np.float64] | None,
    directions: NDArray[np.float64],
    rng: np.random.Generator | None,
) -> NDArray[np.uint16]:  # (n,) mm
    """Report one sweep, in the order in which light and electronics spoil it.

    1. A surface beyond `range` sends no echo; one nearer than `minimum_range` blinds the beam.
    2. Echoes from grazing incidence are lost, then a share `dropout` of the others. The law of
       diffuse reflection (Lambert, Photometria, 1760) lets the echo fade as the sine of the
       grazing angle; the limit stands for where it falls below the receiver's threshold.
    3. The echoes get Gaussian errors, are rounded to `quantum`, and stay within the device's span,
       for an error does not make an echo one that was not seen.
    4. Millimetres: a blinded beam is `DROPPED`. Lost echoes and emptiness look alike: `NO_RETURN`
       if the device takes that for free space, else `DROPPED`.

    An ideal device draws nothing; any other draws two numbers a beam, so that one error's size
    does not shift another's draws.

    Args:
        device: Device that measures.
        distance: (n,) along the beams, m; -1 for a miss.
        incidence_cosine: (n,) of the angle between beam and surface normal, of either sign; may be
            None unless the device loses grazing beams.
        directions: (n, 3) unit vectors, sensor frame.
        rng: See `stream`; None will do for an ideal device.

    Raises:
        ValueError: No incidence for a device that loses grazing beams, or no random numbers for
            one that errs.
    """
    noise = device.noise
    true = distance * directions[:, 0] if device.measures == "depth" else distance
    value, lost = true, NONE_LOST
    if noise.grazing > 0.0:
        if incidence_cosine is None:
            raise ValueError("incidence_cosine: got None, expected (n,): grazing beams are lost")
        lost = ~(np.abs(incidence_cosine) >= math.sin(noise.grazing))
    if noise != RangeNoise():
        if rng is None:
            raise ValueError("rng: got None, expected a generator: the device errs")
        value = _with_errors(device, true, rng)
        dropped = rng.random(len(true)) < noise.dropout
        lost = lost | dropped if len(lost) else dropped
    silence = NO_RETURN if device.no_return_is_free else DROPPED
    limits = float(device.minimum_range), float(device.range)
    reported: NDArray[np.uint16] = report(distance, true, value, lost, *limits, silence)
    return reported


@allocating
def report(
    distance: NDArray[np.float64],
    true: NDArray[np.float64],
    value: NDArray[np.float64],
    lost: NDArray[np.bool_],
    minimum_range: float,
    range_limit: float,
    silence: np.uint16,
) -> NDArray[np.uint16]:
    """Apply steps 1, 2 and 4 of `measure` in one pass over the beams; return (n,) mm.

    Args:
        distance: (n,) along the beams, m; -1 for a miss.
        true: (n,) report of an ideal device, m.
        value: (n,) the same with its errors.
        lost: (n,) whether an echo is lost; (0,) if none is.
        minimum_range: m.
        range_limit: m.
        silence: Report of a beam without echo.
    """
    reported = np.empty(len(true), np.uint16)
    for n in range(len(true)):
        if not (distance[n] >= 0.0 and true[n] <= range_limit):
            reported[n] = silence
        elif true[n] < minimum_range:
            reported[n] = DROPPED
        elif len(lost) > 0 and lost[n]:
            reported[n] = silence
        elif value[n] < 0.0 or value[n] > range_limit:
            reported[n] = NO_RETURN
        else:
            millimetres = np.rint(value[n] * MILLIMETRES)
            reported[n] = np.uint16(min(max(millimetres, 1.0), float(NO_RETURN) - 1.0))
    return reported


def warm_up() -> None:
    """Compile the kernel, or load it from the cache."""
    report(np.zeros(1), np.zeros(1), np.zeros(1), NONE_LOST, 0.0, 1.0, NO_RETURN)


def _with_errors(
    device: Device, true: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    noise = device.noise
    sigma = np.sqrt(
        noise.sigma**2
        + (noise.sigma_proportional * true) ** 2
        + (noise.sigma_quadratic * true**2) ** 2
    )
    value = true + sigma * rng.standard_normal(len(true))
    if noise.quantum > 0.0:
        value = np.rint(value / noise.quantum) * noise.quantum
    clipped: NDArray[np.float64] = np.clip(value, device.minimum_range, device.range)
    return clipped
