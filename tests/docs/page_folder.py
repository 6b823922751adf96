"""Folder in which the blocks of a page run: links, and files that pages presuppose."""

from pathlib import Path

import numpy as np

from tests.docs.programs import ROOT


def set_up_folder():
    """Set up the folder of a page: links to models and examples, and files of other programs."""
    Path("docs").mkdir()
    for folder in ("models", "examples"):
        Path(folder).symlink_to(ROOT / folder)
    pillar = (
        "<model name='p'><static>1</static><pose>-3.5 7 0 0 0 0</pose><link name='l'><collision"
        " name='c'><geometry><cylinder><radius>0.075</radius><length>1</length></cylinder>"
        "</geometry></collision></link></model>"
    )
    world = f"<sdf version='1.6'><world name='default'>{pillar}</world></sdf>"
    Path("world_1.world").write_text(world)
    Path("DIR").mkdir()
    Path("DIR/world_1.world").write_text(world)
    np.save("DIR/path_1.npy", np.array([[16, j] for j in range(31)]))
    Path("DIR/easy_0.csv").write_text("s, 8, 0, 4, 1, 0, 0, 0, 1.5, 1.5, 1.5")
