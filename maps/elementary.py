"""Elementary functions with the same bits on every processor.

The ones of a C library differ in their last bits: it chooses variants by what the processor
offers. These are sums, products, quotients and square roots alone, which IEEE 754 rounds alike
everywhere, in a fixed order, on numbers of twice the length: the sum of two floats (Dekker, "A
floating-point technique for extending the available precision", 1971; Hida, Li, Bailey,
"Algorithms for quad-double precision floating point arithmetic", 2001). So the result is the float
nearest to the true value, but for one in some 2^40 that lies almost between two.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

Long = tuple[float, float]
"""A number as the sum of two floats, the second at most half a unit in the last place of the first.
"""

SPLIT = 134217729.0  # 2^27 + 1
HALF_PI = (1.5707963267948966, 6.123233995736766e-17)
LN_2 = (0.6931471805599453, 2.3190468138462996e-17)
SQRT_HALF = 0.7071067811865476
MAX_ANGLE = 1e6
"""Greatest angle, rad; beyond, HALF_PI has too few digits."""


def sines_cosines(angles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sines and cosines of angles (n,), rad, each shape (n,).

    Raises:
        ValueError: An angle is not finite, or of a million or more.
    """
    if not (np.abs(angles) < MAX_ANGLE).all():
        raise ValueError(f"angles: got {angles}, expected each below {MAX_ANGLE:g} rad")
    sines, cosines = np.empty(len(angles)), np.empty(len(angles))
    _fill_sines_cosines(np.ascontiguousarray(angles, np.float64), sines, cosines)
    return sines, cosines


def cosine(angle: float) -> float:
    """Return the cosine of an angle, rad."""
    return float(sines_cosines(np.array([angle]))[1][0])


def tangent(angle: float) -> float:
    """Return the tangent of an angle, rad.

    Raises:
        ValueError: As of `sines_cosines`.
    """
    if not abs(angle) < MAX_ANGLE:
        raise ValueError(f"angle: got {angle:g}, expected below {MAX_ANGLE:g} rad")
    return float(_tangent(float(angle)))


def arc_tangent(y: float, x: float) -> float:
    """Return the angle of the direction (x, y) from the x axis, in [-pi, pi], rad.

    As in C, the sign of a zero is that of the side from which it was reached.
    """
    return float(_arc_tangent(float(y), float(x)))


def exponentials(powers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the exponential function of powers of any shape."""
    values = np.empty(powers.shape)
    _fill_exponentials(np.array(powers, np.float64).reshape(-1), values.reshape(-1))
    return values


def exponential_less_one(power: float) -> float:
    """Return the exponential function less one, exact for small powers too."""
    return float(_exponential_less_one(float(power)))


def logarithm(value: float) -> float:
    """Return the natural logarithm of a value above 0.

    Raises:
        ValueError: The value is not above 0 and finite.
    """
    if not 0.0 < value < math.inf:
        raise ValueError(f"logarithm: got {value:g}, expected above 0, finite")
    return float(_logarithm(float(value)))


def norm(vector: NDArray[np.float64]) -> float:
    """Return the Euclidean length of a vector (n,)."""
    return float(_norm(np.ascontiguousarray(vector, np.float64)))


@kernel
def _sum(a: float, b: float) -> Long:
    """Return the exact sum of two floats (Knuth)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


@kernel
def _halves(a: float) -> Long:
    """Return the upper and lower half of a float's digits (Veltkamp)."""
    scaled = SPLIT * a
    high = scaled - (scaled - a)
    return high, a - high


@kernel
def _product(a: float, b: float) -> Long:
    """Return the exact product of two floats (Dekker)."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return product, error


@kernel
def _added(a: Long, b: Long) -> Long:
    high, low = _sum(a[0], b[0])
    return _sum(high, low + (a[1] + b[1]))


@kernel
def _times(a: Long, b: Long) -> Long:
    high, low = _product(a[0], b[0])
    return _sum(high, low + (a[0] * b[1] + a[1] * b[0]))


@kernel
def _over(a: Long, divisor: float) -> Long:
    quotient = a[0] / divisor
    high, low = _product(quotient, divisor)
    return _sum(quotient, ((a[0] - high) - low + a[1]) / divisor)


@kernel
def _sine_cosine(angle: float) -> tuple[Long, Long]:
    """Evaluate the series about the nearest quarter turn, each term from the one before."""
    quarters = math.floor(angle / HALF_PI[0] + 0.5)
    rest = _added((angle, 0.0), _times((-quarters, 0.0), HALF_PI))
    square = _times(rest, rest)
    sine, cosine = (1.0, 0.0), (1.0, 0.0)
    for n in range(13, 0, -1):
        of_sine = _over(_times(square, sine), -2.0 * n * (2.0 * n + 1.0))
        of_cosine = _over(_times(square, cosine), -2.0 * n * (2.0 * n - 1.0))
        sine, cosine = _added((1.0, 0.0), of_sine), _added((1.0, 0.0), of_cosine)
    sine = _times(rest, sine)
    turned = int(quarters) % 4
    if turned % 2 == 1:
        sine, cosine = cosine, (-sine[0], -sine[1])
    if turned >= 2:
        sine, cosine = (-sine[0], -sine[1]), (-cosine[0], -cosine[1])
    return sine, cosine


@kernel
def _fill_sines_cosines(
    angles: NDArray[np.float64],  # (n,)
    sines: NDArray[np.float64],  # (n,) out
    cosines: NDArray[np.float64],  # (n,) out
) -> None:
    for i in range(len(angles)):
        sine, cosine = _sine_cosine(angles[i])
        sines[i], cosines[i] = sine[0], cosine[0]


@kernel
def _tangent(angle: float) -> float:
    sine, cosine = _sine_cosine(angle)
    quotient = sine[0] / cosine[0]
    left = _added(sine, _times((-quotient, 0.0), cosine))
    return quotient + left[0] / cosine[0]


@kernel
def _arc_tangent(y: float, x: float) -> float:
    """Evaluate by half-angle steps and the series, then one Newton step by sine and cosine."""
    behind = math.copysign(1.0, x) < 0.0
    if x == 0.0 and y == 0.0:
        return math.copysign(2.0 * HALF_PI[0] if behind else 0.0, y)
    scale = -math.frexp(max(abs(x), abs(y)))[1]
    x, y = math.ldexp(x, scale), math.ldexp(y, scale)  # exact
    steep = abs(y) > abs(x)
    t = abs(x) / abs(y) if steep else abs(y) / abs(x)
    for _ in range(3):  # atan(t) = 2 atan(t / (1 + sqrt(1 + t^2)))
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    q = t * t
    angle = 8.0 * t * (1.0 - q * (1 / 3 - q * (1 / 5 - q * (1 / 7 - q * (1 / 9 - q * (1 / 11))))))
    if steep:
        angle = HALF_PI[0] - angle
    if behind:
        angle = 2.0 * HALF_PI[0] - angle
    angle = math.copysign(angle, y)
    sine, cosine = _sine_cosine(angle)
    across = _added(_times((y, 0.0), cosine), _times((-x, 0.0), sine))
    return angle + across[0] / (x * cosine[0] + y * sine[0])


@kernel
def _exponential(power: float) -> tuple[Long, int]:
    """Return the exponential as a number and the power of two that it is multiplied by."""
    twos = math.floor(power / LN_2[0] + 0.5)
    rest = _added((power, 0.0), _times((-twos, 0.0), LN_2))
    value = (1.0, 0.0)
    for n in range(24, 0, -1):
        value = _added((1.0, 0.0), _over(_times(rest, value), float(n)))
    return value, int(twos)


@kernel
def _fill_exponentials(
    powers: NDArray[np.float64],  # (n,)
    values: NDArray[np.float64],  # (n,) out
) -> None:
    for i in range(len(powers)):
        if powers[i] > 710.0:
            values[i] = math.inf
        elif powers[i] < -746.0:
            values[i] = 0.0
        else:
            value, twos = _exponential(powers[i])
            values[i] = math.ldexp(value[0], twos)


@kernel
def _exponential_less_one(power: float) -> float:
    value, twos = _exponential(power)
    scaled = math.ldexp(value[0], twos), math.ldexp(value[1], twos)
    return _added(scaled, (-1.0, 0.0))[0]


@kernel
def _logarithm(value: float) -> float:
    """Evaluate the series of the inverse hyperbolic tangent, then one Newton step."""
    part, twos = math.frexp(value)
    if part < SQRT_HALF:
        part, twos = 2.0 * part, twos - 1
    t = (part - 1.0) / (part + 1.0)
    series = 0.0
    for n in range(23, 0, -2):
        series = 1.0 / n + t * t * series
    guess = 2.0 * t * series + twos * LN_2[0]
    inverse, more = _exponential(-guess)
    scale = math.ldexp(1.0, more + twos)
    share = _times((part * scale, 0.0), inverse)  # 1 but for the error of the guess
    return guess + _added(share, (-1.0, 0.0))[0]


@kernel
def _norm(vector: NDArray[np.float64]) -> float:
    squared = (0.0, 0.0)
    for i in range(len(vector)):
        squared = _added(squared, _product(vector[i], vector[i]))
    root = math.sqrt(squared[0])
    if root == 0.0:
        return 0.0
    high, low = _product(root, root)
    left = _added(squared, (-high, -low))
    return root + left[0] / (2.0 * root)
