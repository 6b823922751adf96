"""Gazebo worlds (`.world`, `.sdf`) and URDF: their collision shapes as one static scene.

Source: the SDFormat specification, versions 1.4 to 1.12. A `<state>` is where Gazebo saved its
models; it holds the poses that count.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from wayproof.models.classes import CLASSES
from wayproof.models.world_files.locating import Locator
from wayproof.models.world_files.movers import check_movers
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import moved
from wayproof.models.world_files.reading import FARTHEST, MAX_SOLIDS, WorldFileError
from wayproof.models.world_files.sdf_actors import read_actor
from wayproof.models.world_files.sdf_frames import ORIGIN, Frames, Placement, numbers
from wayproof.models.world_files.sdf_includes import SHOWN, Includes
from wayproof.models.world_files.sdf_shapes import Shapes
from wayproof.models.world_files.urdf import as_model
from wayproof.models.world_files.xml_tree import Element, read_xml
from wayproof.models.worlds.solids.solid import class_of

LEFT_OUT = ("road", "population")
"""Elements of a world that are not taken over, each with a note of its line."""


def read_sdf(path: Path, options: ImportOptions) -> Found:
    """Read every collision shape of every model.

    Raises:
        WorldFileError: Naming the element and its line that cannot be taken over.
    """
    root = read_xml(path)
    scopes = [child for child in root.children if child.tag in ("world", "model")]
    if root.tag == "robot":
        scopes = [as_model(path, root)]
    elif root.tag not in ("sdf", "gazebo") or not scopes:
        what = f"<{root.tag}>: expected <sdf> with one <world> or <model>, or <robot>"
        raise WorldFileError(path, what, 1)
    if len(scopes) > 1:
        what = f"{len(scopes)} worlds or models, expected one <world> or <model>"
        raise WorldFileError(path, what, scopes[1].line)
    reading = _Reading(path, options)
    scope = reading.includes.written_out(path, scopes[0])
    if scope.tag == "model":
        reading.take_model(path, scope, Frames(path, scope).placed(scope, ORIGIN, None), "")
    else:
        reading.take_world(path, scope)
    reading.finish()
    return reading.found


class _Reading:
    """One file and the files that it includes."""

    def __init__(self, path: Path, options: ImportOptions) -> None:
        self.found = Found()
        locator = Locator(path, options.model_paths)
        self._shapes = Shapes(self.found, options, locator)
        self.includes = Includes(locator, self._shapes)

    def take_world(self, path: Path, world: Element) -> None:
        frames, saved = Frames(path, world), _Saved(path, world.first("state"))
        for child in [*world.children, *saved.inserted]:
            name, file = child.attributes.get("name", ""), child.file or path
            if child.tag in ("model", "ground") and name in saved.deleted:
                continue
            if child.tag == "model":
                placed = frames.placed(child, ORIGIN, Frames(file, child))
                self.take_model(file, child, placed, _shown(child), saved.models.get(name))
            elif child.tag == "ground":
                self._shapes.ground(frames.placed(child, ORIGIN, None), _shown(child))
            elif child.tag == "actor":
                self._take_actor(file, child, frames)
            elif child.tag in LEFT_OUT:
                self.found.notes.append(f"<{child.tag}> '{name}' (line {child.line}): left out")

    def _take_actor(self, path: Path, actor: Element, frames: Frames) -> None:
        mover, note = read_actor(path, actor, frames, len(self.found.movers))
        self.found.movers.append(mover)
        self.found.notes.append(note)
        try:
            check_movers(self.found.movers)
        except ValueError as error:
            raise WorldFileError(path, f"<actor>: {error}", actor.line) from None

    def finish(self) -> None:
        """Write the notes that hold for many models at once."""
        self._shapes.finish()
        self._leave_out_lost()

    def _leave_out_lost(self) -> None:
        """Leave out models that fell or flew off before the world was saved, if others are left."""
        parts = self.found.parts
        lost = [not float(np.abs(part.bounds).max()) <= FARTHEST for part in parts]
        if not any(lost) or all(lost):
            return
        names = dict.fromkeys(part.model for part, away in zip(parts, lost, strict=True) if away)
        self.found.parts = [part for part, away in zip(parts, lost, strict=True) if not away]
        self.found.notes.append(
            f"more than {FARTHEST / 1e3:g} km away: left out ({', '.join(names)[:200]})"
        )

    def take_model(
        self, path: Path, model: Element, placed: Placement, name: str, state: _State | None = None
    ) -> None:
        """Read all links of a model at T_world_model, or at its saved pose."""
        frames = Frames(path, model)
        if model.text_of("static") not in ("1", "true"):
            self._shapes.say("models that can move: they stand still here")
        if state is not None and state.placed is not None:
            placed = state.placed
        for child in model.children:
            inner, file = child.attributes.get("name", ""), child.file or path
            if child.tag == "link":
                own = frames.of(child)
                at, scale = placed @ own, np.ones(3)
                if state is not None:
                    at = state.links.get(inner, at)
                    scale = state.scale
                self._take_link(file, child, at, name, scale, frames, own)
            elif child.tag == "model":
                nested = placed @ frames.placed(child, ORIGIN, Frames(file, child))
                within = None if state is None else state.models.get(inner)
                self.take_model(file, child, nested, name or _shown(child), within)
            elif child.tag == "ground":
                at = placed @ frames.placed(child, ORIGIN, None)
                self._shapes.ground(at, name or _shown(child))

    def _take_link(
        self,
        path: Path,
        link: Element,
        placed: Placement,
        model: str,
        scale: np.ndarray,
        frames: Frames,
        own: Placement,
    ) -> None:
        """Read the shapes of a link at T_world_link.

        Args:
            path: File of the link, for messages.
            link: The link.
            placed: T_world_link.
            model: Name of its model.
            scale: (3,) factors that a saved state gives to the model.
            frames: Frames of the model: a shape's pose may be relative to one of them.
            own: T_model_link.
        """
        within = Frames(path, link)
        for shape in self._shapes.solid_in(link, model):
            pose = shape.first("pose")
            if pose is not None and pose.attributes.get("relative_to"):
                at = placed @ own.inverse() @ frames.of(shape)
            else:
                at = placed @ within.of(shape)
            for part in self._shapes.parts(path, shape, at, model, scale):
                kind = part.kind if part.shape == "heights" else _kind_of(model)
                part = replace(moved(part, at.position, at.R), model=model, kind=kind)
                self.found.parts.append(part)
                if len(self.found.parts) > MAX_SOLIDS:
                    raise WorldFileError(path, f"more than {MAX_SOLIDS} shapes", shape.line)


def _kind_of(model: str) -> str:
    """Return the kind of a model by its name: lower-case letters and underscores, no number.

    A name alone makes nothing a floor: `--as` does.
    """
    word = re.sub(r"[_ ]*\d+$", "", model.strip().lower())
    kind = re.sub("[^a-z_]+", "_", word).strip("_")[:40] or "structure"
    return "structure" if class_of(kind) == CLASSES.index("floor") else kind


def _shown(model: Element) -> str:
    """Return the name by which a model is known to the user."""
    return model.attributes.get(SHOWN, model.attributes.get("name", ""))


class _State:
    """Saved poses T_world and scale of a model, of its links, and of the models in it."""

    def __init__(self, path: Path, model: Element) -> None:
        scale = model.first("scale")
        self.scale = np.ones(3) if scale is None else np.array(numbers(path, scale, 3))
        if not (self.scale > 0.0).all():
            assert scale is not None
            raise WorldFileError(path, "<scale>: expected positive numbers", scale.line)
        frames = Frames(path, Element("state", {}, model.line))
        self.placed = None if model.first("pose") is None else frames.of(model)
        self.links = {
            link.attributes.get("name", ""): frames.of(link)
            for link in model.all("link")
            if link.first("pose") is not None
        }
        self.models = {
            inner.attributes.get("name", ""): _State(path, inner) for inner in model.all("model")
        }


class _Saved:
    """The saved state of a world: of its models, and which were inserted or deleted since."""

    def __init__(self, path: Path, state: Element | None) -> None:
        self.models: dict[str, _State] = {}
        self.inserted: list[Element] = []
        self.deleted: set[str] = set()
        if state is None:
            return
        self.models = {one.attributes.get("name", ""): _State(path, one)
                       for one in state.all("model")}  # fmt: skip
        for insertions in state.all("insertions"):
            self.inserted += list(insertions.all("model"))
        for deletions in state.all("deletions"):
            self.deleted |= {name.text.strip() for name in deletions.all("name")}
