"""Facts of an episode with one thing wrong, and the cause that they leave."""

from dataclasses import replace

from wayproof.harness.attribution.pose import PoseFacts
from wayproof.harness.attribution.ranges import RangeFacts

LIED = PoseFacts(error=0.5, covered=0.1, beyond=0.4, at_end=0.5)
BAD = RangeFacts(lost=0.3)


def cause_of(tests, facts):
    return next(name for name, test in tests if test(facts) is not None)


def changed(facts, changes):
    """Facts with some of them changed, of a part by `part.name`."""
    for name, value in changes.items():
        part, _, inner = name.partition(".")
        if inner:
            whole = getattr(facts, part)
            value = with_one(whole() if callable(whole) else whole, inner, value)
        facts = with_one(facts, part, value)
    return facts


def with_one(facts, name, value):
    """Facts with another value of one name, whether it is measured at once or when called."""
    measured = callable(getattr(facts, name))
    return replace(facts, **{name: (lambda: value) if measured else value})
