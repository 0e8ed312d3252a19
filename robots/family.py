"""Families: descriptions of many robots, told apart by parameters that are words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from closedchain.urdf.errors import DescriptionError, known_names


@dataclass(frozen=True)
class Choice:
    """A parameter that takes one of a few words.

    Attributes
    ----------
    words : tuple of str
        What it may be; the first is the default.
    refused : mapping of str to str
        Words that the source of the family offers but that make no member, and why.
    """

    words: tuple[str, ...]
    refused: Mapping[str, str] = field(default_factory=dict)

    def check(self, name: str, word: object) -> None:
        """Raise ``DescriptionError`` unless ``word`` is one that parameter ``name`` may take."""
        if word in self.words:
            return
        listed = ", ".join(self.words)
        if isinstance(word, str) and word in self.refused:
            raise DescriptionError(
                f"parameter {name!r} cannot be {word!r}: {self.refused[word]}; known: {listed}"
            )
        raise DescriptionError(known_names(str(word), f"value of parameter {name!r}:", self.words))
