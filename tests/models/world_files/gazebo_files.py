"""Gazebo worlds and meshes that tests write."""

from wayproof.models.world_files import ImportOptions
from wayproof.models.world_files.importer import import_world

ENDS = {"start": (0.0, 0.0, 0.0), "goal": (3.0, 0.0, 0.0)}

CUBE = "\n".join(
    ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 0 0 1", "v 1 0 1", "v 1 1 1", "v 0 1 1",
     "f 1 3 2", "f 1 4 3", "f 5 6 7", "f 5 7 8", "f 1 2 6", "f 1 6 5", "f 2 3 7", "f 2 7 6",
     "f 3 4 8", "f 3 8 7", "f 4 1 5", "f 4 5 8"]
)  # fmt: skip
"""A cube of 1 m."""

PLANE = """<model name='ground'><static>1</static><link name='l'><collision name='c'>{pose}
  <geometry><plane><normal>{normal}</normal><size>20 20</size></plane></geometry></collision></link>
  </model>"""
BOX = """<model name='{name}'{attribute}><static>1</static>{pose}<link name='l'>{link}
  <collision name='c'><geometry><box><size>{size}</size></box></geometry>{surface}</collision>
  </link></model>"""


def world(*content):
    return f"<sdf version='1.7'><world name='w'>{''.join(content)}</world></sdf>"


def ground(pose="", normal="0 0 1"):
    return PLANE.format(pose=pose, normal=normal)


def box(name="box", size="1 1 1", pose="", link="", surface="", attribute=""):
    return BOX.format(name=name, size=size, pose=pose, link=link, surface=surface,
                      attribute=attribute)  # fmt: skip


def mesh(uri, more=""):
    return f"""<sdf version='1.6'><model name='m'><static>1</static><link name='l'>
      <collision name='c'><geometry><mesh><uri>{uri}</uri>{more}</mesh></geometry></collision>
      </link></model></sdf>"""


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def read(path, **more):
    return import_world(path, ImportOptions(**more), **ENDS)
