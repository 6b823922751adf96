"""Write the splat of a generated world, made of its geometry.

Usage: python -m tests.tools.world_splat WORLD SEED FILE.ply
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.prior.of_world import splat_of_world
from wayproof.harness.prior.splats import NEEDED, Gaussians
from wayproof.harness.scenario.worlds import find_world


def write_splat(path: Path, splat: Gaussians) -> None:
    """Write Gaussians as a binary `.ply`; colours are grey."""
    names = [*NEEDED[:3], "f_dc_0", "f_dc_1", "f_dc_2", "opacity", *NEEDED[3:10]]
    table = np.zeros(len(splat.means), [(name, "<f4") for name in names])
    for k, name in enumerate(NEEDED[:3]):
        table[name] = splat.means[:, k]
    for k, name in enumerate(NEEDED[3:6]):
        table[name] = np.log(splat.deviations[:, k])
    for k, name in enumerate(NEEDED[6:10]):
        table[name] = splat.quaternions[:, k]
    table["opacity"] = np.log(splat.opacities / (1.0 - splat.opacities))
    properties = "".join(f"property float {name}\n" for name in names)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n{properties}"
    path.write_bytes(f"{head}end_header\n".encode() + table.tobytes())


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
