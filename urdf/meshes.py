"""Where the mesh files lie that a description names."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from lxml import etree

from closedchain.urdf.description import Description

_PACKAGE, _FILE = "package://", "file://"
FEW = 3  # missing meshes that are named one by one
ROS_PATH = "ROS_PACKAGE_PATH"


def with_mesh_paths(description: Description) -> tuple[str, tuple[str, ...]]:
    """Text of a description whose visuals name their mesh files in full, and what is missing.

    A path is relative to the file. ``package://NAME/...`` is looked for in ``package_dirs``, in the
    folders of ROS_PACKAGE_PATH, and in the folders above the file that are called NAME. A visual
    whose mesh is not found is taken out, with a sentence; the others stay.
    """
    text = description.text
    if "mesh" not in text:
        return text, ()
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    root = etree.fromstring(text.encode("utf-8"), parser)
    missing: list[tuple[str, str]] = []
    for link in root.iterfind("./{*}link"):
        for visual in link.findall("./{*}visual"):
            mesh = visual.find("./{*}geometry/{*}mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            found = next((path for path in _places(name, description) if path.is_file()), None)
            if found is None:
                link.remove(visual)
                missing.append((name, link.get("name", "")))
            else:
                mesh.set("filename", str(found))
    return etree.tostring(root, encoding="unicode"), tuple(_missed(missing))


def _missed(missing: list[tuple[str, str]]) -> Iterator[str]:
    """Sentences on meshes and their links, one for all where there are many."""
    if len(missing) > FEW:
        name, link = missing[0]
        yield (
            f"{len(missing)} meshes were not found, such as {name!r} of link {link!r}"
            f"{_hint(name)}: their links are drawn without them"
        )
        return
    for name, link in missing:
        yield (
            f"mesh {name!r} of link {link!r} was not found{_hint(name)}: the link is drawn "
            "without it"
        )


def _places(name: str, description: Description) -> Iterator[Path]:
    folder = Path(description.folder or os.curdir)
    if name.startswith(_PACKAGE):
        package, _, rest = name.removeprefix(_PACKAGE).lstrip("/").partition("/")
        ros = os.environ.get(ROS_PATH, "").split(os.pathsep)
        for place in (*description.package_dirs, *filter(None, ros)):
            yield Path(place) / package / rest
            if Path(place).name == package:
                yield Path(place) / rest
        for above in folder.parents:
            if above.name == package:
                yield above / rest
    elif name.startswith(_FILE):
        yield folder / unquote(name.removeprefix(_FILE))
    elif name:
        yield folder / name


def _hint(name: str) -> str:
    return " (name its folder: package_dirs, --package-dir)" if name.startswith(_PACKAGE) else ""
