"""``python -m website``: build the site into build/site; every warning is an error."""

from __future__ import annotations

import logging
import shutil
import sys
import time
from pathlib import Path

from website import gallery, notebooks, pages, reference
from website.navigation import navigation
from website.offline import fetching_pages

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build"


def main() -> int:
    """Gather, generate, build; says what takes how long."""
    try:
        from mkdocs.commands.build import build
        from mkdocs.config import load_config
    except ModuleNotFoundError:
        sys.exit("the site is built by mkdocs: pip install 'closedchain[docs]', or make env")
    source = BUILD / "site_source"
    shutil.rmtree(source, ignore_errors=True)
    for what, write in (
        ("pages of the repository", pages.gather),
        ("notebooks", notebooks.write),
        ("reference", reference.write),
        ("gallery", gallery.write),
    ):
        began = time.monotonic()
        write(ROOT, source)
        print(f"{what}: {time.monotonic() - began:.1f} s", flush=True)
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING)
    config = load_config(
        str(ROOT / "website" / "mkdocs.yml"),
        docs_dir=str(source),
        site_dir=str(BUILD / "site"),
        nav=navigation(source),
        strict=True,
    )
    build(config)
    site = BUILD / "site"
    if found := fetching_pages(site):
        sys.exit("\n".join(found))
    print(f"open {site / 'index.html'}; to search it, serve it: python -m http.server -d {site}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
