"""Write the splat of a generated world, made of its geometry.

Usage: python -m tests.tools.world_splat WORLD SEED FILE.ply
"""

from __future__ import annotations

import argparse
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.prior.splats import write_splat
from wayproof.harness.prior.world_splat import splat_of_world
from wayproof.harness.scenario.worlds import find_world


def main() -> None:
    """Write the splat."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world")
    parser.add_argument("seed", type=int)
    parser.add_argument("file", type=Path)
    options = parser.parse_args()
    splat = splat_of_world(find_world(Config(options.world, "", options.seed)))
    write_splat(options.file, splat)
    print(f"{len(splat.means)} Gaussians: {options.file}")


if __name__ == "__main__":
    main()
