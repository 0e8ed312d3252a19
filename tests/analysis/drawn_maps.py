"""Maps and sets made by hand, for the figures."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from closedchain.analysis.survey.set_tables import SavedSet

STATUSES = ("ok", "none found", "other branch", "joint limit", "not converged", "behind a limit")


def made_map(start: tuple[float, ...] | None = None, **axes: np.ndarray) -> xr.Dataset:
    """Map whose measures vanish where the first coordinate does; all cells are ok."""
    shape = tuple(len(values) for values in axes.values())
    first = np.broadcast_to(
        next(iter(axes.values())).reshape(-1, *(1 for _ in shape[1:])), shape
    ).copy()
    values = {
        "sigma_direct": np.abs(first),
        "sigma_inverse": 1.0 + np.abs(first),
        "det_direct": first,
        "condition": 1.0 / np.maximum(np.abs(first), 1e-9),
    }
    labels = {
        "flag_values": list(range(len(STATUSES))),
        "flag_meanings": " ".join(s.replace(" ", "_") for s in STATUSES),
    }
    variables: dict[str, Any] = {
        "status": (tuple(axes), np.zeros(shape, dtype=np.int8), labels),
        **{name: (tuple(axes), v, {"units": "1"}) for name, v in values.items()},
    }
    lengths = ("x", "y", "z")
    coordinates = {n: (n, v, {"units": "m" if n in lengths else "rad"}) for n, v in axes.items()}
    found = xr.Dataset(variables, coords=coordinates)
    if start is not None:
        found.attrs = {"start": "home"}
        found.attrs |= {f"start_{n}": v for n, v in zip(axes, start, strict=True)}
    return found


def made_set(
    kind: str,
    over: tuple[str, ...],
    coordinates: Any,
    pieces: tuple[Any, ...] = (),
    *,
    ends: tuple[tuple[str, str], ...] = (),
    on_branch: Any = None,
    everywhere: bool = False,
) -> SavedSet:
    """Set with given points and pieces; one piece through all points by default."""
    points = np.asarray(coordinates, dtype=float).reshape(-1, len(over))
    n = len(points)
    indices = tuple(np.asarray(piece) for piece in pieces) or ((np.arange(n),) if n else ())
    kinds = frozenset({"direct", "inverse"} if kind == "combined" else {kind})
    dimension = 2 if indices and indices[0].ndim == 2 else 1
    return SavedSet(
        kind=kind,
        over=over,
        units=tuple("m" if name in ("x", "y", "z") else "rad" for name in over),
        coordinates=points,
        q=np.arange(2.0 * n).reshape(n, 2),
        kinds=(kinds,) * n,
        sigmas=np.full((n, 3), 0.5),
        dimension=dimension,
        pieces=indices,
        ends=ends,
        on_branch=np.ones(n, dtype=bool) if on_branch is None else np.asarray(on_branch),
        everywhere=everywhere,
        verdict="curve",
        note="made by hand",
    )


def sphere(radius: float, n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) and triangles (T, 3) of a sphere about the origin."""
    from scipy.spatial import ConvexHull

    height, turn = np.meshgrid(
        np.linspace(-1.0, 1.0, n + 2)[1:-1], np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    )
    flat = np.sqrt(1.0 - height**2)
    points = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=-1).reshape(-1, 3)
    return radius * points, np.asarray(ConvexHull(points).simplices)
