"""How far a posture is from the nearest singular one: Newton's method on the bordered equations.

A small singular value is no distance. It may grow with the cube of the way from the singular
postures, so that it is tiny far away from them; and at a fold, where postures are known to the root
of the rounding only, it is not tiny at the very place. So where one is small the singular posture
beside is sought: closure rows zero, corners g of the bordered matrix zero (``sets.bordered``), each
step the least in the norm of the rates of all physical joints. How far it is gets compared with the
accuracy to which the posture is known:

* closure rows of size r leave it uncertain by r / s, s the least singular value of K that counts;
  and no posture is taken to be known better than ``KNOWN``, which is what stated numbers and traced
  sets are good for;
* at a fold, more: with g the corner and v its null motion, the singular posture lies about
  a = -g / (dg . v) along v, and on the way there rows change by a g only. Where that is rounding,
  a posture that was solved for from inputs, or from a pose, may as well be the one as the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.joint_rates import physical_rates
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearness import (
    CUT,
    FALLEN,
    FLOATING,
    KNOWN,
    LONGEST,
    ROOT,
    ROUNDING,
    SAFETY,
    STEPS,
)
from closedchain.closure.solve.control import CLOSED


@dataclass(frozen=True)
class Nearest:
    """The singular posture that Newton's method leads to from a posture.

    Attributes
    ----------
    distance : float
        In the norm of physical joint rates; infinite where none was found.
    accuracy : float
        To which the posture is known, in the same norm.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> near = cc.classify(m, m.home).nearest["inverse"]
    >>> near.distance <= near.accuracy  # home is singular
    True
    """

    distance: float
    accuracy: float

    @property
    def here(self) -> bool:
        """Whether the posture cannot be told from a singular one."""
        return self.distance <= self.accuracy


@dataclass(frozen=True, eq=False)
class Place:
    """A posture (nq,), its largest dimensionless closure row, and the closures' rank there.

    ``least`` is the smallest singular value of K that counts, ``lost`` the ranks that K lacks.
    """

    mechanism: Mechanism
    q: np.ndarray
    residual: float
    least: float
    lost: int = 0

    @property
    def accuracy(self) -> float:
        """To which rows alone tell the posture."""
        return max(KNOWN, SAFETY * (self.residual + ROUNDING) / max(self.least, 1e-300))

    @cached_property
    def rates(self) -> np.ndarray:
        """P (k, nv)."""
        return physical_rates(self.mechanism, self.q)

    @cached_property
    def weights(self) -> np.ndarray:
        """W (nv, nv) with |P W y| = |y|, but for motions that no joint rate sees."""
        gram = self.rates.T @ self.rates
        lower = np.linalg.cholesky(gram + FLOATING * np.eye(len(gram)))
        return np.asarray(np.linalg.solve(lower.T, np.eye(len(lower))))


def nearest_singular(place: Place, measure: Measure, rank: int, lost: int) -> Nearest:
    """Seek the posture where a measure's matrix, of generic rank ``rank``, has ``lost`` less."""
    search = _Search(place, measure.losing(min(measure.shape) - rank + lost), lost)
    try:
        return Nearest(search.distance(), max(place.accuracy, search.fold_accuracy()))
    except np.linalg.LinAlgError:  # some other number of ranks is lost there
        return Nearest(np.inf, place.accuracy)


@dataclass(frozen=True, eq=False)
class _Search:
    place: Place
    measure: Measure
    lost: int

    def at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Closure rows and their slopes, corners and theirs, dimensionless.

        Where the closures themselves lose ranks, that many combinations of rows are left out: they
        hold to second order.
        """
        m, r = self.place.mechanism, generic_rank(self.place.mechanism)
        lost = self.lost if self.measure.kind == "constraint" else self.place.lost
        at, combine = self.measure.code.at(q), None
        rows, slopes = at.residual, at.closures
        if r < m.rows or lost:
            combine = np.linalg.svd(slopes)[0][:, :r].T
            rows, slopes = combine[: r - lost] @ rows, combine[: r - lost] @ slopes
        borders = self.measure.borders(at, combine)
        corners, gradients = self.measure.evaluate(q, at, combine, borders)
        return rows, slopes, np.atleast_1d(corners), gradients

    @cached_property
    def first(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The equations at the posture itself."""
        return self.at(self.place.q)

    def distance(self) -> float:
        """Of the posture that the steps end in."""
        place, q, moved = self.place, self.place.q, 0.0
        rows, slopes, corners, gradients = self.first
        begin = float(np.abs(corners).max())
        for _ in range(STEPS):
            if np.abs(corners).max() <= ROUNDING:
                return moved
            size = np.linalg.norm(gradients, axis=1)
            told = size > ROUNDING
            scale = np.where(told, size, 1.0)[:, None]
            matrix = np.vstack([slopes, (gradients / scale)[told]]) @ place.weights
            values = np.concatenate([rows, (corners / scale[:, 0])[told]])
            step = -place.weights @ np.linalg.lstsq(matrix, values, rcond=CUT)[0]
            length = float(np.linalg.norm(place.rates @ step))
            if not np.isfinite(length):
                return np.inf
            q = self._moved(q, step * min(1.0, LONGEST / max(length, 1e-300)))
            last, moved = moved, self._away(q)
            rows, slopes, corners, gradients = self.at(q)
            if (
                length < 1e-3 * max(KNOWN, moved)
                and abs(moved - last) < 1e-3 * moved + 1e-3 * KNOWN
            ):
                break
        return moved if np.abs(corners).max() <= max(FALLEN * begin, ROUNDING) else np.inf

    def _moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        m = self.place.mechanism
        return np.asarray(pin.integrate(m.model, q, step * m.column_scale))

    def _away(self, q: np.ndarray) -> float:
        m = self.place.mechanism
        change = pin.difference(m.model, self.place.q, q) / m.column_scale
        return float(np.linalg.norm(self.place.rates @ change))

    def fold_accuracy(self) -> float:
        """To which the root alone tells the posture, where it lies beside a fold; else 0."""
        place, (_, _, corners, gradients) = self.place, self.first
        rounding = SAFETY * (min(place.residual, CLOSED) + ROUNDING)
        size = float(np.abs(corners).max())
        reach = min(rounding / max(size, 1e-300), ROOT * float(np.sqrt(rounding)))
        motions = self._null_motions()
        slopes = gradients @ motions
        along = np.linalg.lstsq(slopes, -corners, rcond=CUT)[0]
        left = float(np.abs(slopes @ along + corners).max())
        away = float(np.linalg.norm(place.rates @ motions @ along))
        return reach if left <= 0.1 * size and away <= reach else 0.0

    def _null_motions(self) -> np.ndarray:
        """Motions (nv, k) that the matrix nearly takes to zero."""
        m = self.place.mechanism
        matrix = self.measure.matrix(self.measure.code.at(self.place.q), None)
        vt = np.linalg.svd(matrix)[2]
        count = self.measure.corank + max(self.measure.shape[1] - self.measure.shape[0], 0)
        motions = vt[len(vt) - count :].T
        if self.measure.kind != "direct":
            return np.asarray(motions)
        every = np.zeros((m.model.nv, count))
        every[m.passive_v] = motions
        return every
