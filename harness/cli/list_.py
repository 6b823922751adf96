"""`wayproof list`: list worlds, robots, sensors, maps, planners and settings."""

from __future__ import annotations

import argparse

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli.verb import Document, Verb


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Print the names in each registry."""
    from wayproof.harness.config import BUILTIN, setting_names
    from wayproof.harness.interface.stacks import STACKS
    from wayproof.harness.perturbations import PERTURBATIONS
    from wayproof.maps import MAPS
    from wayproof.models.robots import ROBOTS
    from wayproof.models.sensors.devices import DEVICES
    from wayproof.models.worlds import WORLDS
    from wayproof.planners import PLANNERS

    document = {
        "worlds": sorted(WORLDS),
        "robots": sorted(ROBOTS),
        "sensors": sorted(DEVICES),
        "maps": sorted(MAPS),
        "planners": sorted(PLANNERS),
        "stacks": [BUILTIN, *sorted(STACKS)],
        "perturbations": sorted(PERTURBATIONS),
        "settings": setting_names(),
    }
    for kind, names in document.items():
        console.print(Text.assemble((kind, "bold"), f": {', '.join(names)}"))
    return 0, document


VERB = Verb(
    help="list worlds, robots, sensors, maps, planners, perturbations and settings",
    add_arguments=lambda parser: None,
    run=run,
    example="wayproof list --json",
)
