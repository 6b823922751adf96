"""`wayproof import`: make a world file from a file of another tool."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli import check_robot
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, check_ending, given, point
from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole

WORLDS = Path("worlds")


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Read a file, write the world file, and print what was left out."""
    from wayproof.models.world_files import ImportOptions, WorldFileError
    from wayproof.models.world_files.importer import import_world

    out = options.out or WORLDS / f"{options.file.stem}.xml"
    check_ending("--out", out, ".xml")
    try:
        radius, height, step = _robot_size(options.robot)
        import_options = ImportOptions(
            **given(ImportOptions, options),
            robot_radius=radius,
            robot_height=height,
            robot_step=step,
        )
        world, notes = import_world(options.file, import_options, options.start, options.goal)
    except WorldFileError as error:
        raise InputError(str(error)) from None
    except ValueError as error:
        raise InputError(f"import: {error}") from None
    with written_whole(out, "--out") as partial:
        partial.write_text(world.text, encoding="utf-8")
    document: Document = {
        "world": str(out), "name": world.identity, "solids": len(world.solids),
        "low": world.low, "high": world.high, "start": world.start, "goal": world.goal,
        "notes": notes,
    }  # fmt: skip
    console.print(f"{out}: {len(world.solids)} solids, {world.identity}")
    for note in notes:
        console.print(f"  {note}")
    return 0, document


def _kind(text: str) -> tuple[str, str]:
    """Parse `KIND=MODEL`."""
    kind, equals, model = text.partition("=")
    if not (equals and model and kind.replace("_", "").isalpha() and kind.islower()):
        raise InputError(f"--as: got '{text}', expected KIND=MODEL, such as floor=ground*")
    return kind, model


def _robot_size(name: str) -> tuple[float, float, float]:
    """Return radius and height of the robot that will run, and the height that it steps over, m."""
    from wayproof.harness.config import Config
    from wayproof.harness.scenario.robots import find_robot

    spec = find_robot(Config(world="", seed=0, robot=name)).spec
    return spec.radius, spec.height, spec.step_height


def _place(name: str, text: str) -> tuple[float, float, float]:
    """Parse `X,Y` or `X,Y,Z`; Z is 0 by default."""
    x, y, z = (*point(name, text), 0.0)[:3]
    return x, y, z


VERB = Verb(
    help="make a world file from a Gazebo world, MJCF, map, table or mesh; check a robot's spec",
    add_arguments=arguments(
        arg("FILE", "file to import; its extension is the format", Path),
        arg("--out FILE.xml", "world file (default: worlds/NAME.xml)", Path),
        arg(
            "--start X,Y[,Z]",
            "start, m (default: the file's, or chosen)",
            partial(_place, "--start"),
        ),
        arg(
            "--goal X,Y[,Z]", "goal, m (default: the file's, or chosen)", partial(_place, "--goal")
        ),
        arg(
            "--height M",
            "height of obstacles of a flat map, or of white in a height image, m (default: 2)",
            float,
        ),
        arg("--resolution M", "cell size where the file gives none, m (default: 0.1)", float),
        arg("--scale M", "metres per unit of a mesh (default: 1)", float),
        arg(
            "--unknown STATE",
            "state of the unknown cells of a flat map: occupied or free (default: occupied)",
            choices=("occupied", "free"),
        ),
        arg("--skip-missing", "leave out models and meshes that are not found"),
        arg("--visuals", "make solid what has visuals only, and collisions without contact"),
        arg(
            "--model-path DIR",
            "folder with models that a Gazebo world includes (repeatable)",
            Path,
            [],
            action="append",
            dest="model_paths",
        ),
        arg("--floor Z", "height of the floor in the file, m (default: its plane's, or 0)", float),
        arg(
            "--as KIND=MODEL",
            "kind of the models of that name or pattern, such as floor=ground* (repeatable)",
            _kind,
            [],
            action="append",
            dest="kinds",
        ),
        arg("--robot R", "robot for which start and goal are chosen", default="quadruped"),
        arg(
            "--without BODY",
            "body of a MuJoCo scene to leave out, with all on it (repeatable)",
            default=[],
            action="append",
        ),
        arg(
            "--root DIR",
            "folder below which a MuJoCo scene may name files (default: the scene's own)",
            Path,
        ),
    ),
    run=run,
    example="wayproof import world_1.world --start=-2.25,3 --goal=-2.25,13",
    kinds={"robot": check_robot.VERB},
)
