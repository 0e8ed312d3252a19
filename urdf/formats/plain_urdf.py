"""A description as URDF: the tree that every parser reads, and the loops as ``<constraint>``."""

from __future__ import annotations

from closedchain.urdf.description import Description
from closedchain.urdf.formats.written import Written, homes_left_out, listed
from closedchain.urdf.writing import document_text, urdf_document


def write(description: Description) -> Written:
    """URDF of a description; stock parsers load its tree and read over the rest."""
    losses = []
    loops = [closure.name for closure in description.closures]
    loops += [relation.name for relation in description.relations]
    if loops:
        losses.append(
            f"programs that read URDF alone get the open tree: {listed(loops)} are <constraint> "
            "elements, which they read over"
        )
    losses += homes_left_out(description)
    return Written(document_text(urdf_document(description)), tuple(losses))
