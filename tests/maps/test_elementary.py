"""Elementary functions against exact series in whole numbers."""

import math
from fractions import Fraction

import numpy as np
import pytest

from wayproof.maps import elementary

ONE = 1 << 200  # of the exact series


def exactly(terms):
    """The sum of terms given as fractions, until they vanish."""
    total = 0
    for term in terms:
        scaled = term.numerator * ONE // term.denominator
        if scaled == 0:
            return Fraction(total, ONE)
        total += scaled


def sine_terms(x, first):
    term = x if first else Fraction(1)
    n = 1 if first else 0
    while True:
        yield term
        # Cut to 200 bits, or the fractions grow without end.
        term = -term * x * x / ((n + 1) * (n + 2))
        term = Fraction(term.numerator * ONE // term.denominator, ONE)
        n += 2


def exponential_terms(x):
    term, n = Fraction(1), 0
    while True:
        yield term
        n += 1
        term = term * x / n
        term = Fraction(term.numerator * ONE // term.denominator, ONE)


def draws(low, high, count=30):
    return np.random.default_rng(7).uniform(low, high, count)


def wrong(found, exact):
    """Share of floats that are not the nearest to the exact values."""
    nearest = [float(value) for value in exact]
    return np.mean(np.asarray(found) != nearest)


@pytest.mark.parametrize("span", [1e-3, 0.8, 1.6, 20.0])
def test_sines_and_cosines_are_the_nearest_floats(span):
    angles = draws(-span, span)
    sines, cosines = elementary.sines_cosines(angles)
    assert wrong(sines, [exactly(sine_terms(Fraction(a), True)) for a in angles]) == 0
    assert wrong(cosines, [exactly(sine_terms(Fraction(a), False)) for a in angles]) == 0


def test_exponentials_are_the_nearest_floats():
    powers = draws(-30.0, 5.0)
    exact = [exactly(exponential_terms(Fraction(p))) for p in powers]
    assert wrong(elementary.exponentials(powers), exact) == 0
    assert elementary.exponentials(np.array([[-800.0, 0.0], [1.0, 800.0]])).tolist() == [
        [0.0, 1.0],
        [math.e, math.inf],
    ]


def test_a_small_power_loses_no_digit_of_what_is_beyond_one():
    for power in draws(-1e-4, 1e-4):
        exact = exactly(exponential_terms(Fraction(power))) - 1
        assert elementary.exponential_less_one(power) == float(exact)


def test_a_logarithm_undoes_the_exponential_to_the_last_digit():
    for value in 10.0 ** draws(-6.0, 6.0):
        found = elementary.logarithm(value)
        exact = exactly(exponential_terms(Fraction(found)))
        # The error of the argument, which is that of the result by its derivative 1 / value.
        assert abs(exact / Fraction(value) - 1) <= Fraction(math.ulp(found)) * Fraction(5001, 10000)
    for value in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="logarithm"):
            elementary.logarithm(value)


def test_an_arc_tangent_is_that_of_the_direction():
    rng = np.random.default_rng(3)
    for y, x in rng.normal(size=(30, 2)).tolist():
        found = elementary.arc_tangent(y, x)
        sine = exactly(sine_terms(Fraction(found), True))
        cosine = exactly(sine_terms(Fraction(found), False))
        across = (Fraction(y) * cosine - Fraction(x) * sine) / (
            Fraction(x) * cosine + Fraction(y) * sine
        )
        assert abs(across) <= Fraction(math.ulp(found)) * Fraction(5001, 10000)


@pytest.mark.parametrize(
    ("y", "x"),
    [
        *((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (1.0, 1.0), (-1.0, -1.0)),
        *((-0.0, -1.0), (0.0, -0.0), (-0.0, 0.0), (1e-320, -1e-320), (1e300, 1e-300)),
    ],
)
def test_an_arc_tangent_of_an_axis_or_of_nothing_is_as_in_c(y, x):
    found, expected = elementary.arc_tangent(y, x), math.atan2(y, x)
    assert (found, math.copysign(1.0, found)) == (expected, math.copysign(1.0, expected))


def test_a_tangent_is_the_nearest_float():
    angles = draws(-1.5, 1.5)
    exact = [
        exactly(sine_terms(Fraction(a), True)) / exactly(sine_terms(Fraction(a), False))
        for a in angles
    ]
    assert wrong([elementary.tangent(a) for a in angles], exact) == 0
    with pytest.raises(ValueError, match="below"):
        elementary.tangent(math.nan)
    with pytest.raises(ValueError, match="below"):
        elementary.sines_cosines(np.array([0.0, math.inf]))


def test_a_norm_is_the_nearest_float():
    for vector in np.random.default_rng(5).normal(size=(30, 3)):
        squared = sum(Fraction(x) ** 2 for x in vector)
        found = Fraction(elementary.norm(vector))
        half = Fraction(math.ulp(float(found))) / 2
        assert (found - half) ** 2 <= squared <= (found + half) ** 2
    assert elementary.norm(np.zeros(3)) == 0.0
