"""Changes of a scene that no world knows of."""

from collections.abc import Callable
from dataclasses import replace

import mujoco

from wayproof.harness.scenario.robots import built_in
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.scene import bind

GLASS_RGBA = [0.8, 0.9, 1.0, 0.0]
"""Colour of glass, which no beam hits: its alpha is 0."""


def edit_scene(scenario: Scenario, edit: Callable[[mujoco.MjSpec], None]) -> Scenario:
    """Return the scenario of a registered robot with its scene changed and compiled anew.

    The world keeps what it was generated from, so only the scene knows of the change.
    """
    spec = mujoco.MjSpec.from_string(scenario.scene.mjcf)
    edit(spec)
    spec.compile()
    config = scenario.config
    scene = bind(spec.to_xml(), built_in(config)[config.robot], config.sensors)
    return replace(scenario, scene=scene)


def transparent(is_glass: Callable[[mujoco.MjsGeom], bool]) -> Callable[[mujoco.MjSpec], None]:
    """Return an edit that makes geoms invisible to every beam, as glass is to a lidar."""

    def clear(spec: mujoco.MjSpec) -> None:
        for geom in filter(is_glass, spec.geoms):
            geom.rgba = GLASS_RGBA

    return clear
