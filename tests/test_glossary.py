"""The glossary: in order, each entry leads on, and the words that pages use are there."""

import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "glossary.md"
ENTRIES = dict(re.findall(r"^## ([^\n]+)\n\n(.+?)\n*(?=^## |\Z)", PAGE.read_text(), re.M | re.S))
WORDS = (
    "assembly mode, working mode, aspect, direct singularity, inverse singularity, combined "
    "singularity, constraint singularity, Zlatanov's six types, misfit, kept rows, redundant row, "
    "spelling, branch, sheet, tape, screw order, closure, cusp, fold, home, posture, self-motion"
)


def test_entries_are_in_the_order_of_the_alphabet() -> None:
    titles = [title.lower() for title in ENTRIES]
    assert titles == sorted(titles)
    assert len(titles) == len(re.findall(r"^## ", PAGE.read_text(), re.M))


def test_every_entry_leads_to_a_page() -> None:
    """That the pages and headings are there is tested for all pages alike, in test_docs."""
    for title, text in ENTRIES.items():
        assert re.search(r"\]\(\w+\.md(#[\w-]+)?\)", text), title


def test_the_words_of_the_pages_are_there() -> None:
    titles = {title.lower() for title in ENTRIES}
    assert {word.strip().lower() for word in WORDS.split(",")} <= titles
