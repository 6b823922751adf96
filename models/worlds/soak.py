"""Draw worlds until the time is up: no seed may crash a generator or give a world that is shut.

Usage: python -m models.worlds.soak [SECONDS] [FIRST_SEED]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from itertools import count

from models.worlds import WORLDS, World

DIFFICULTIES = (0.0, 0.5, 1.0)


def soak(seconds: float, first_seed: int) -> Counter[str]:
    """Draw every world at every difficulty, seed by seed, for so much processor time.

    Returns:
        How many worlds were drawn, by name.

    Raises:
        RuntimeError: A generator failed; the message names world, seed and difficulty.
    """
    drawn: Counter[str] = Counter()
    end = time.process_time() + seconds
    for seed in count(first_seed):
        for name in WORLDS:
            for difficulty in DIFFICULTIES:
                draw(name, seed, difficulty)
                drawn[name] += 1
                if time.process_time() >= end:
                    return drawn
    return drawn


def draw(name: str, seed: int, difficulty: float) -> World:
    """Draw one world and write its MJCF.

    Raises:
        RuntimeError: Either failed.
    """
    try:
        world = WORLDS[name](seed, difficulty)
        world.mjcf()
    except Exception as error:
        raise RuntimeError(f"world {name}, seed {seed}, difficulty {difficulty}: {error}") from None
    return world


def main() -> None:
    """Run with the given time and seed, and print the counts."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    drawn = soak(seconds, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(f"{sum(drawn.values())} worlds, none failed: {dict(drawn)}")


if __name__ == "__main__":
    main()
