"""Foreign world files that tests write, and the worlds that they are read as."""

import mujoco
import numpy as np

from wayproof.models.world_files import ImportOptions
from wayproof.models.world_files.importer import import_world

ENDS = {"start": (0.0, 0.0, 0.0), "goal": (3.0, 0.0, 0.0)}

SDF = """<sdf version='1.6'><world name='default'>
  <light name='sun' type='directional'/>
  <model name='ground_plane'><static>1</static><link name='link'><collision name='c'><geometry>
    <plane><normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>
  {models}
</world></sdf>
"""

PILLAR = """<model name='pillar'><static>1</static><pose frame=''>{pose}</pose>
  <link name='link'><collision name='c'><geometry><cylinder><radius>0.075000</radius>
  <length>1</length></cylinder></geometry></collision></link></model>"""


def write(folder, name, text):
    path = folder / name
    if isinstance(text, bytes):
        path.write_bytes(text)
    else:
        path.write_text(text)
    return path


def sdf(folder, *models, name="some.world"):
    return write(folder, name, SDF.format(models="\n".join(models)))


def imported(path, **more):
    options = ImportOptions(**more)
    return import_world(path, options, **ENDS)[0]


def one_ray(world, origin, ray):
    model = mujoco.MjModel.from_xml_string(world.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hit = np.zeros(1, np.int32)
    return mujoco.mj_ray(model, data, np.array(origin), np.array(ray), None, 1, -1, hit)


MAP = "image: m.pgm\nresolution: 0.5\norigin: [1.0, 0.0, {yaw}]\nnegate: {negate}\n" \
      "occupied_thresh: 0.65\nfree_thresh: 0.196 # usual\n"  # fmt: skip
PCD_HEAD = "# .PCD v0.7\nFIELDS x y z intensity\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 1\n"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
