"""Small files in the formats of published benchmarks."""

import numpy as np

PILLAR = """<model name='p{n}'><static>1</static><pose frame=''>{x} {y} 0 0 0 0</pose>
<link name='l'><collision name='c'><geometry><cylinder><radius>0.075</radius><length>1</length>
</cylinder></geometry></collision></link></model>"""


def barn_folder(folder, gap):
    """A wall of pillars across the way with a gap, and a reference path through it."""
    places = [(x, 7.0) for x in np.arange(-4.9, 0.5, 0.15) if abs(x + 2.25) > gap / 2]
    models = "".join(PILLAR.format(n=n, x=x, y=y) for n, (x, y) in enumerate(places))
    (folder / "world_7.world").write_text(f"<sdf version='1.6'><world>{models}</world></sdf>")
    # x = 0.15 i - 4.575 and y = 0.15 j + 5.075, from (-2.175, 5.075) straight to (-2.175, 9.575)
    np.save(folder / "path_7.npy", np.array([[16, j] for j in range(31)]))
    return folder


def field_folder(folder):
    rows = ["s, 8, 0, 4, 1, 0, 0, 0, 1.5, 1.5, 1.5", "s, 1000, 0, 4, 1, 0, 0, 0, 1, 1, 1"]
    (folder / "easy_0.csv").write_text("\n".join(rows))
    return folder
