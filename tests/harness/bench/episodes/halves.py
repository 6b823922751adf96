"""A job for other processes, in a file that imports next to nothing."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Half:
    """The half of a number that is odd or even."""

    parity: str
    number: int
    half: float

    @property
    def job(self):
        return self.parity, self.number


def half(parity, number):
    return Half(parity, number, number / 2)
