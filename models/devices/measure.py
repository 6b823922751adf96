"""From true distances to what a device reports."""

from __future__ import annotations

import hashlib
import math

import numpy as np
from numpy.typing import NDArray

from models.beams import DROPPED, NO_RETURN, quantise
from models.devices.device import Device
from models.devices.noise import RangeNoise


def stream(seed: int, name: str, sequence: int) -> np.random.Generator:
    """The random numbers of one event, whatever was drawn before it.

    Args:
        seed: The episode's, >= 0.
        name: What the numbers are for, such as a sensor's name.
        sequence: Number of the event, >= 0.
    """
    # Python's own hash of a string differs from process to process.
    key = int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "little")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key, sequence)))


def measure(
    device: Device,
    distance: NDArray[np.float64],
    incidence_cosine: NDArray[np.float64] | None,
    directions: NDArray[np.float64],
    rng: np.random.Generator,
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
        device: What measures.
        distance: (n,) along the beams, m; -1 for a miss.
        incidence_cosine: (n,) of the angle between beam and surface normal, of either sign; may be
            None unless the device loses grazing beams.
        directions: (n, 3) unit vectors, sensor frame.
        rng: See `stream`.

    Raises:
        ValueError: No incidence for a device that loses grazing beams.
    """
    noise = device.noise
    true = distance * directions[:, 0] if device.measures == "depth" else distance
    echo = (distance >= 0.0) & (true <= device.range)
    blinded = echo & (true < device.minimum_range)
    if noise.grazing > 0.0:
        if incidence_cosine is None:
            raise ValueError("incidence_cosine: got None, expected (n,): grazing beams are lost")
        echo &= np.abs(incidence_cosine) >= math.sin(noise.grazing)
    value = true
    if noise != RangeNoise():
        value = _with_errors(device, true, rng)
        echo &= rng.random(len(true)) >= noise.dropout
    silence = NO_RETURN if device.no_return_is_free else DROPPED
    reported = np.where(echo, quantise(value, device.range), silence)
    reported[blinded] = DROPPED
    return reported


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
