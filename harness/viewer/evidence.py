"""Evidence of the map in one layer: age and probability of occupancy, cell by cell."""

from __future__ import annotations

from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.mission import Mission
from wayproof.harness.viewer.layer import COLOURS
from wayproof.maps import UNKNOWN, Costmap, Representation

Array = NDArray[np.float64]

OLD_S = 30.0
"""Age from which on evidence has one colour, s."""

AGE, PROBABILITY = mpl.colormaps["viridis_r"], mpl.colormaps["YlOrRd"]
"""Colours of ages, young to old, and of probabilities, 0 to 1; neither has a grey."""

WORDS = {
    "age": f"age, s: yellow 0, violet {OLD_S:g}",
    "probability": "probability: pale 0, red 1",
}
"""Titles with the key to the colours; unknown cells have no place on either scale."""


class Evidence(NamedTuple):
    """Evidence for the cells of one layer; not a number in unknown cells.

    Attributes:
        age_s: (nx, ny) time since the last observation, s.
        probability: (nx, ny) probability of occupancy.
    """

    age_s: Array
    probability: Array

    def images(self) -> dict[str, NDArray[np.uint8]]:
        """Return both as colours (ny, nx, 3), least y first, by the names of `WORDS`."""
        ages = AGE(np.clip(self.age_s / OLD_S, 0.0, 1.0))
        return {
            "age": _image(ages, np.isnan(self.age_s)),
            "probability": _image(PROBABILITY(self.probability), np.isnan(self.probability)),
        }


def evidence_at(
    a_map: Representation, costmap: Costmap, layer: int, mission: Mission, time_ns: int
) -> Evidence:
    """Return the evidence for a layer of a costmap.

    On the ground the age is that in the plane of planning, as in a decision's evidence age, and the
    probability the greatest in the column that the body sweeps.

    Args:
        a_map: Map that the costmap was made from.
        costmap: The costmap.
        layer: Index along z.
        mission: Its body.
        time_ns: Simulated time, ns.
    """
    nx, ny, _ = costmap.shape
    size = costmap.resolution
    x, y = (costmap.origin[k] + (np.arange(n) + 0.5) * size for k, n in enumerate((nx, ny)))
    across = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    here = costmap.origin[2] + (layer + 0.5) * size
    observed = a_map.observed_ns_at(np.column_stack([across, np.full(len(across), here)]))
    heights = [here]
    if mission.planar:
        heights = np.arange(mission.step_height + 0.5 * size, mission.height, size).tolist()
    probability = np.max(
        [a_map.probability_at(np.column_stack([across, np.full(len(across), z)])) for z in heights],
        axis=0,
    )
    unknown = (costmap.state[:, :, layer] == UNKNOWN).ravel()
    age = np.where(unknown | (observed < 0), np.nan, (time_ns - observed) * 1e-9)
    return Evidence(age.reshape(nx, ny), np.where(unknown, np.nan, probability).reshape(nx, ny))


def _image(colours: Array, unknown: NDArray[np.bool_]) -> NDArray[np.uint8]:
    image = np.round(255.0 * colours[..., :3]).astype(np.uint8)
    image[unknown] = COLOURS[UNKNOWN]
    return image.transpose(1, 0, 2)
