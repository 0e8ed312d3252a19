"""Where the links, joints and frames of an SDF model are: its ``relative_to`` worked off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from closedchain.urdf import elements
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.sdf.text_values import child, children, pose_in, word

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

MODEL, WORLD = "__model__", "world"


class Frames:
    """Poses of everything that has a name in a model, in the model's frame."""

    def __init__(self, model: Element) -> None:
        """Collect what has a name; poses are worked off when they are asked for."""
        self._said: dict[str, Element] = {}
        self._known: dict[str, np.ndarray] = {MODEL: np.eye(4)}
        world = np.linalg.inv(pose_in(child(model, "pose")))
        self._known[WORLD] = world
        for tag in ("link", "frame", "joint"):
            for element in children(model, tag):
                name = elements.text(element, "name")
                taken = self._said.get(name)
                if name in self._known or (taken is not None and tag in ("link", taken.tag)):
                    raise elements.error(element, "the name is used twice, or reserved")
                # in older files a joint may be called as a link is; the link is meant then
                self._said.setdefault(name, element)

    def pose(self, name: str, asked: Element) -> np.ndarray:
        """Pose (4, 4) of a link, joint or frame in the model.

        Raises
        ------
        DescriptionError
            At ``asked``: no such name, a nested one, or frames that refer to each other in a
            circle.
        """
        chain: list[str] = []
        while name not in self._known:
            if name in chain:
                raise elements.error(asked, f"frames in a circle: {' -> '.join([*chain, name])}")
            if name not in self._said:
                nested = "; frames of nested models are not read" if "::" in name else ""
                raise elements.error(asked, known_names(name, "frame", self._said) + nested)
            chain.append(name)
            name = self._base(self._said[name])
        found = self._known[name]
        for inner in reversed(chain):
            found = found @ pose_in(child(self._said[inner], "pose"))
            self._known[inner] = found
        return found

    def of(self, element: Element, default: str) -> np.ndarray:
        """Pose in the model of an element that has a ``<pose>`` but no name of its own."""
        written = child(element, "pose")
        base = default if written is None else (written.get("relative_to") or default)
        return self.pose(base, element) @ pose_in(written)

    def axes(self, axis: Element, joint: np.ndarray, old: bool) -> np.ndarray:
        """Rotation (3, 3), in the model, of the frame that an axis is written in.

        ``joint`` is the pose (4, 4) of its joint; ``old``: up to SDF 1.4 axes are written in the
        model's frame.
        """
        xyz = child(axis, "xyz")
        named = "" if xyz is None else xyz.get("expressed_in", "")
        in_model = word(axis, "use_parent_model_frame", "1" if old else "0") in ("1", "true")
        if named:
            return self.pose(named, axis)[:3, :3]
        return np.eye(3) if in_model else joint[:3, :3]

    def body(self, name: str, asked: Element) -> str:
        """Link that a name stands for: a link, the world, or what a frame is attached to."""
        seen: list[str] = []
        while name in self._said and self._said[name].tag != "link":
            if name in seen:
                raise elements.error(asked, f"frames in a circle: {' -> '.join([*seen, name])}")
            seen.append(name)
            element = self._said[name]
            name = (
                word(element, "child") if element.tag == "joint"
                else element.get("attached_to") or MODEL
            )  # fmt: skip
        if name not in (*self._said, WORLD, MODEL):
            nested = "; links of nested models are not read" if "::" in name else ""
            links = [n for n, e in self._said.items() if e.tag == "link"]
            raise elements.error(asked, known_names(name, "link", links) + nested)
        return name

    @staticmethod
    def _base(element: Element) -> str:
        """Frame that the pose of an element is relative to."""
        written = child(element, "pose")
        named = "" if written is None else written.get("relative_to", "")
        if named:
            return str(named)
        if element.tag == "joint":
            return word(element, "child")
        if element.tag == "frame":
            return str(element.get("attached_to") or MODEL)
        return MODEL
