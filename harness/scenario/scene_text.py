"""Scenes from a log, checked before MuJoCo reads them: self-contained MJCF alone.

MJCF can name files, include others, load plug-ins and request any amount of memory in a few bytes.
Scenes in our logs are flattened, so one with any of that is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from wayproof.harness.errors import InputError
from wayproof.models.world_files.mjcf_files import Bounds
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.xml_tree import Element

MAX_CHARACTERS = 64 * 2**20
"""Maximum size of a scene's text, as of an imported world: two million heights take half of it."""

MAX_ELEMENTS = 50_000

REFUSED_ELEMENTS = frozenset(
    "include plugin extension instance model attach flexcomp composite replicate skin "
    "deformable".split()
)
"""Elements that name files or code, or that multiply."""

REFUSED_ATTRIBUTES = frozenset(
    "meshdir texturedir assetdir plugin memory njmax nconmax nstack content_type model_file".split()
)
"""Attributes that name folders, code or amounts of memory, besides those beginning with `file`."""

MAX_SIZES = {"width": 2048, "height": 2048, "nkey": 64}
"""Maximum of attributes that MuJoCo allocates by, besides the bounds of every import."""

MAX_DEPTH = 100
"""Maximum nesting of elements; our own scenes have about ten."""

TIMESTEPS = (1e-4, 0.05)
"""Minimum and maximum physics step, s."""


def safe_scene(text: str) -> str:
    """Parse and serialize a scene's text, so that MuJoCo reads what was checked.

    Raises:
        InputError: The text is no XML, too large, or not self-contained.
    """
    if len(text) > MAX_CHARACTERS:
        raise InputError(f"scene: {len(text)} characters, expected at most {MAX_CHARACTERS}")
    if "<!" in text.replace("<!--", "").replace("<![CDATA[", ""):
        raise InputError("scene: a document type, expected plain MJCF")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"scene: {error}") from None
    if root.tag != "mujoco":
        raise InputError(f"scene: <{root.tag[:40]}>, expected <mujoco>")
    bounds = Bounds()
    for count, (element, depth) in enumerate(_walk(root)):
        if count >= MAX_ELEMENTS:
            raise InputError(f"scene: more than {MAX_ELEMENTS} elements")
        if depth > MAX_DEPTH:
            raise InputError(f"scene: more than {MAX_DEPTH} elements within one another")
        _check(element)
        _check_bounds(bounds, element)
        if element.tag == "text" and element.text:
            # MuJoCo saves what holds quotes as CDATA, and parsing drops it.
            element.set("data", element.text)
            element.text = None
    return ElementTree.tostring(root, encoding="unicode")


def _walk(root: ElementTree.Element) -> Iterator[tuple[ElementTree.Element, int]]:
    """Yield every element with its depth, without recursion, which a deep scene would exhaust."""
    ahead = [(root, 1)]
    while ahead:
        element, depth = ahead.pop()
        yield element, depth
        ahead.extend((child, depth + 1) for child in element)


def _check_bounds(bounds: Bounds, element: ElementTree.Element) -> None:
    """Check sizes and counts by the numbers written, as of an imported scene."""
    try:
        bounds.check(Path("scene"), Element(str(element.tag), element.attrib, 0))
    except WorldFileError as error:
        raise InputError(str(error).replace("scene:0: ", "scene: ")) from None


def _check(element: ElementTree.Element) -> None:
    tag = str(element.tag)
    if tag in REFUSED_ELEMENTS:
        raise InputError(f"scene: <{tag}> is refused, expected a flattened scene")
    for name, value in element.attrib.items():
        if name in REFUSED_ATTRIBUTES or name.startswith("file"):
            raise InputError(f"scene: <{tag[:40]} {name}=...> is refused, expected no file or size")
        if name in MAX_SIZES and _number(tag, name, value) > MAX_SIZES[name]:
            raise InputError(f"scene: <{tag[:40]} {name}>: expected at most {MAX_SIZES[name]}")
        if name == "timestep" and not TIMESTEPS[0] <= _number(tag, name, value) <= TIMESTEPS[1]:
            raise InputError(f"scene: timestep {value[:20]}, expected {TIMESTEPS[0]} to 0.05 s")


def _number(tag: str, name: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"scene: <{tag[:40]} {name}>: expected a number")
    return number
