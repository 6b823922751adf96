"""Drawn world files are read right, told of or refused, never silently wrong."""

import os

import pytest

from tests.models.world_files.drawn import FORMATS, draw, wrong_rays
from wayproof.models.world_files import ImportOptions, WorldFileError
from wayproof.models.world_files.importer import import_world

EXAMPLES = int(os.environ.get("DRAWN_WORLDS", "20"))
ENDS = {"start": (-7.0, -7.0, 0.0), "goal": (7.0, 7.0, 0.0)}


@pytest.mark.parametrize("name", FORMATS)
def test_the_rays_of_drawn_files_meet_what_they_mean(tmp_path, name):
    refused, told, silent, right = [], [], [], 0
    for seed in range(EXAMPLES // len(FORMATS)):
        folder = tmp_path / str(seed)
        folder.mkdir()
        drawn = draw(name, seed, folder)
        try:
            world, notes = import_world(
                drawn.path, ImportOptions(floor=0.0, **drawn.options), **ENDS
            )
        except WorldFileError as error:
            refused.append((seed, str(error)))
            continue
        wrong, count = wrong_rays(world, drawn, seed)
        if not wrong:
            right += 1
        elif any("left out" in note for note in notes):
            told.append((seed, wrong, count, notes))
        else:
            silent.append((seed, wrong, count, notes))
    print(f"{name}: {right} right, {len(told)} told, {len(refused)} refused, {len(silent)} silent")
    assert silent == []
    assert right >= EXAMPLES // len(FORMATS) // 2, (refused, told)
