"""The gallery: pages that the commands write, in frames, as they are."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Exhibit:
    """A page of a robot: the words of the command that writes it, and the file it writes."""

    title: str
    sentences: str
    words: tuple[str, ...]
    page: str


EXHIBITS = (
    Exhibit(
        "D1, a machine tool on six legs",
        "Six telescopic legs carry a coupler and, hung from it, a platform with the tool. Move a "
        "leg or the tip: the loops stay closed, and where the way meets a singularity the robot "
        "stops and says which kind.",
        ("view", "d1", "--html", "d1.html"),
        "d1.html",
    ),
    Exhibit(
        "Eclipse, and how far it may tilt",
        "The curve holds every direct singularity of the platform's tilt, with its middle at home: "
        "the slider beside the robot goes through them one by one.",
        (
            *("singularities", "eclipse", "--kind", "direct", "--out", "eclipse"),
            *("--over", "tilt=0.3:1.5:9", "--over", "azimuth=-pi:pi:13"),
        ),
        "eclipse/eclipse.html",
    ),
    Exhibit(
        "All working modes of a linear Delta",
        "Eight postures hold the platform at this place. *Go to* leads to each of them.",
        (
            *("postures", "linear_delta", "--xyz", "0.1", "0", "-0.6", "--no-count"),
            *("--html", "linear_delta.html"),
        ),
        "linear_delta.html",
    ),
    Exhibit(
        "A robot that reconfigures itself",
        "Seven inputs move this platform; turning the seventh one takes its legs from one "
        "configuration to another while the others hold the platform.",
        ("view", "rus6", "--html", "rus6.html"),
        "rus6.html",
    ),
)


def write(root: Path, source: Path) -> None:
    """Run the commands, and write the page that shows what they wrote."""
    folder = source / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        "---\nhide: [navigation, toc]\n---",
        "# Gallery",
        "Each frame is the page that the command above it writes: one file that works without a "
        "network and can be sent to anybody. [A page that moves](view.md) says what can be done "
        "with it.",
    ]
    for one in EXHIBITS:
        subprocess.run(
            [sys.executable, "-m", "closedchain.cli", *one.words],
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        if not (folder / one.page).is_file():
            raise FileNotFoundError(f"closedchain {' '.join(one.words)} wrote no {one.page}")
        parts += [
            f"## {one.title}",
            one.sentences,
            f"```sh\nclosedchain {' '.join(one.words)}\n```",
            f'<iframe class="robot" src="gallery/{one.page}" title="{one.title}" loading="lazy">'
            "</iframe>",
            f"[This page alone](gallery/{one.page}){{target=_blank}}",
        ]
    (source / "gallery.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
