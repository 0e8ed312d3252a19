"""Postures around one from which motions lead nowhere that the rank promises, and what closes them.

A posture may be special in that several branches meet at it. Or closures hold to the second order
all along a branch, as where rods stay parallel: then no posture of the branch has more independent
rows, and yet fewer motions than these leave. In either case postures are had by descent over all
rows, and how many rows are independent is judged at each by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.rounding.sensitivity import Sensitivity
from closedchain.closure.rounding.settling import STRIDE
from closedchain.closure.solve.deflate import Deflated, deflated
from closedchain.closure.solve.descend import descend
from closedchain.closure.turns import way

_SLOPE = 1e-5  # dimensionless step of a difference
_STRAIGHT, _NOISE = 10.0, 1e-7  # times what is open, and at least: no bend
_CLEAR = 5.0  # times what rounding may leave of a singular value: one that counts
_AWAY = 0.1  # dimensionless, from the posture around which others are looked for


@dataclass(frozen=True, eq=False)
class Bent:
    """A posture with the strongest directions closed, and the others as the second order lets them.

    What is said of numbers is that of the posture when it is found again with each of them;
    ``beside`` are the postures before and behind it along each motion.
    """

    at: Deflated
    beside: tuple[tuple[np.ndarray, np.ndarray], ...]

    @property
    def q(self) -> np.ndarray:
        """Posture (nq,)."""
        return self.at.q

    @property
    def rank(self) -> int:
        """Independent rows that it is taken to have."""
        return self.at.rank

    @property
    def values(self) -> np.ndarray:
        """Singular values (min(rows, nv),) of the Jacobian."""
        return self.at.values

    @property
    def size(self) -> float:
        """Size that singular values are judged by: 1, or that of the largest."""
        return max(1.0, float(self.values.max(initial=0.0)))

    @property
    def open(self) -> float:
        """Largest dimensionless row, or loss of rank that is missing."""
        return self.at.open

    @property
    def plain(self) -> bool:
        """Whether closures are clearly bent along motions, or hold along them.

        Neither is so near postures where branches meet.
        """
        s = np.linalg.svd(self.at.slopes, compute_uv=False)
        return not ((s < self.at.floor) & (s > max(_STRAIGHT * self.open, _NOISE))).any()

    @property
    def left(self) -> np.ndarray:
        """What no change of the posture closes (k,)."""
        return self._sieved(self.at.left)

    def by_numbers(self, sensitivity: Sensitivity) -> np.ndarray:
        """Derivative (k, n) of ``left`` by numbers."""
        at, rank = self.at, self.at.rank
        here = sensitivity.at(at.q)
        moved = -at.vt[:rank].T @ ((at.u[:, :rank].T @ here).T / at.values[:rank]).T
        parts = [at.spare.T @ here]
        for (ahead, back), bend in zip(self.beside, at.bends, strict=True):
            turned = (sensitivity.at(ahead) - sensitivity.at(back)) / (2.0 * _SLOPE)
            parts.append(at.spare.T @ (turned + bend @ moved))
        return self._sieved(np.vstack(parts))

    def _sieved(self, rows: np.ndarray) -> np.ndarray:
        """Rows (k,) or (k, n) less what moving along the motions would close."""
        u = self.at.bent()[0]
        return np.asarray(rows - u @ (u.T @ rows))


@dataclass(frozen=True)
class Around:
    """How postures are looked for where several branches meet, or hold to the second order.

    Attributes
    ----------
    tolerance : float
        Dimensionless size of what rounding may leave open.
    noise : float
        What derivatives by numbers may be off, which are differences.
    """

    tolerance: float
    noise: float = 1e-8

    @property
    def bent(self) -> float:
        """Singular value, or curvature, that what is open by the tolerance may feign."""
        return float(np.sqrt(self.tolerance))

    def settled(self, equations: Equations, q: np.ndarray, rank: int) -> Bent | None:
        """The posture near ``q`` (nq,) that has such a rank, or nearly; None if there is none."""
        found = deflated(equations, q, rank, self.bent)
        if found is None:
            return None
        steps = _SLOPE * found.motions.T
        beside = tuple(
            (equations.move(found.q, step), equations.move(found.q, -step)) for step in steps
        )
        return Bent(found, beside)

    def spread(
        self, equations: Equations, start: np.ndarray, count: int, seed: int = 0
    ) -> list[Bent]:
        """Up to ``count`` postures around ``start`` (nq,), on all branches; the same always."""
        rng = np.random.default_rng(seed)
        found: list[Bent] = []
        for _ in range(2 * count):
            if len(found) >= count:
                break
            base = start
            if found and rng.uniform() < 0.5:
                base = found[int(rng.integers(len(found)))].q
            near = self._closed(equations, start, self._stepped(equations, base, rng))
            if near is not None:
                found.append(near)
        return found

    def _stepped(
        self, equations: Equations, base: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        _, s, vt = np.linalg.svd(equations.evaluate(base)[1])
        motions = vt[self._count(s) :].T
        along = motions @ rng.standard_normal(motions.shape[1])
        along *= STRIDE * rng.uniform(0.2, 1.0) / max(float(np.abs(along).max(initial=0.0)), 1e-12)
        return equations.move(base, along)

    def _closed(self, equations: Equations, start: np.ndarray, q: np.ndarray) -> Bent | None:
        """Posture near ``q`` (nq,) of a rank that leaves no doubt, away from the start."""
        near = descend(equations, q, floor=self.tolerance)
        if np.abs(near.values / equations.row_scale).max(initial=0.0) > self.tolerance:
            return None
        s = np.linalg.svd(near.system, compute_uv=False)
        rank = self._count(s)
        clear = not rank or s[rank - 1] > _CLEAR * self._floor(s)
        if not clear or rank == equations.free.size:
            return None
        found = self.settled(equations, near.q, rank)
        if found is None or not found.plain:
            return None
        # where branches meet fewer rows are independent than beside: it may have gone back there
        apart = np.linalg.norm(way(equations.mechanism, start, found.q))
        return found if apart > _AWAY else None

    def _count(self, s: np.ndarray) -> int:
        return int((s > self._floor(s)).sum())

    def _floor(self, s: np.ndarray) -> float:
        return self.bent * max(1.0, float(s.max(initial=0.0)))
