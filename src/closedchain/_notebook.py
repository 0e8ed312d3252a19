"""Showing things in a notebook: figures as pictures with words, pages in frames."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from closedchain.robots.embedding import Embedded


def show(what: Figure | Mechanism | Embedded | str, *, dpi: float = 75) -> None:
    """Show something below a cell of a notebook.

    Parameters
    ----------
    what : matplotlib Figure, Mechanism, page of ``Mechanism.show``, or HTML of a whole page
        A figure becomes a picture, its words for those who do not see it; a mechanism the page
        that moves it; HTML, as of ``robots.viewer.static_page``, a frame.
    dpi : float
        Dots per inch of a picture.

    Raises
    ------
    ClosureError
        Something else.
    ModuleNotFoundError
        IPython is not there: the extra ``closedchain[notebooks]`` brings it.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> cc.show(m)  # in a notebook this is the page whose sliders move the robot
    <page of ... kB; its .page is HTML for a file>
    """
    from IPython.display import Image, display

    from closedchain.robots.embedding import Embedded

    if isinstance(what, Mechanism):
        what = what.show()
    elif isinstance(what, str):
        what = Embedded(what)
    if isinstance(what, Embedded):
        display(what)
        return
    figure: Any = what
    if not callable(getattr(figure, "savefig", None)):
        raise ClosureError(
            "show takes a figure, a mechanism, what its show() returns, or a page of HTML, got "
            f"{type(what).__name__}"
        )
    from closedchain.analysis.figures.saving import words_of

    image = BytesIO()
    figure.savefig(image, format="png", dpi=dpi)
    display(Image(image.getvalue(), format="png", alt=words_of(figure)))
