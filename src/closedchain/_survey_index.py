"""The index of a survey's folder: its figures with their words, the robot's page, and the files."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from closedchain.analysis.figures.saving import alt_file

if TYPE_CHECKING:
    from closedchain.analysis.survey.surveying import Survey

_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem}"
    "img{max-width:100%;height:auto}figure{margin:0}"
)


def survey_index(found: Survey, written: Mapping[str, Path]) -> str:
    """Page that leads through the files of a survey, by their names in its folder."""
    images = [path for path in written.values() if path.suffix == ".png"]
    pages = [path for path in written.values() if path.suffix == ".html"]
    title = escape(found.title)
    parts = [f"<h1>{title}</h1>"]
    for page in pages:
        name = escape(page.name)
        parts.append(f'<p><a href="{name}">The robot with its singular sets, to be moved</a></p>')
    for image in images:
        alt = escape(alt_file(image).read_text(encoding="utf-8").strip())
        name = escape(image.name)
        parts.append(f'<figure><a href="{name}"><img src="{name}" alt="{alt}"></a></figure>')
    parts += [f"<p>{escape(str(part.map.attrs['caption']))}</p>" for part in found.slices]
    parts += [f"<p>{escape(note)}</p>" for note in (*found.notes, *found.details)]
    rest = [name for name, path in written.items() if path not in (*images, *pages)]
    links = "".join(f'<li><a href="{escape(n)}">{escape(n)}</a></li>' for n in rest)
    parts.append(f"<h2>Files</h2><ul>{links}</ul>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{title}</title><style>{_STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )
