"""Packages that only some uses need, by the extra of closedchain that installs them."""

from __future__ import annotations

from importlib.util import find_spec

from closedchain.urdf.errors import ClosedChainError

EXTRAS: dict[str, tuple[str, ...]] = {
    "maps": ("xarray", "h5netcdf", "h5py", "zarr", "skimage"),
    "figures": ("matplotlib",),
    "symbolic": ("sympy",),
    "view": ("meshcat", "matplotlib"),
    "distributed": ("distributed",),
}
"""What to import for each; pyproject.toml names what to install."""


class MissingPackageError(ClosedChainError, ImportError):
    """A package that an extra of closedchain installs is not there."""


def require(what: str, *extras: str) -> None:
    """Refuse what needs the packages of extras where they are not installed.

    Parameters
    ----------
    what : str
        What needs them: a clause that the message begins with.
    extras : str
        Keys of ``EXTRAS``.

    Raises
    ------
    MissingPackageError
        Names what is missing and the line that installs it.
    """
    missing = {extra: [name for name in EXTRAS[extra] if not _there(name)] for extra in extras}
    wanted = [extra for extra, names in missing.items() if names]
    if wanted:
        names = dict.fromkeys(name for extra in wanted for name in missing[extra])
        raise MissingPackageError(
            f"{what}; not installed: {', '.join(names)}. "
            f"pip install 'closedchain[{','.join(wanted)}]' brings them"
        )


def _there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ImportError:
        return False
