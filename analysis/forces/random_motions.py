"""Random closed motions at many postures: velocities that the loops allow, all directions alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.generic import dimensionless_jacobian, sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import kernel
from closedchain.closure.solve.problem import problem_of
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.machine import Compiled, compiled

PIVOT = 1e-6  # dimensionless: below it the elimination loses digits, and LAPACK is asked
LARGE = 1e4  # entries of a basis beyond which it loses digits as well
CHUNK = 4096


@dataclass(frozen=True, eq=False)
class RandomMotions:
    """Projects velocities of the tree onto the closed motions of a mechanism."""

    mechanism: Mechanism

    def project(self, q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Closed motions (n, nv) nearest to given ones, SI units.

        Parameters
        ----------
        q : (n, nq) array
            Closed postures.
        wanted : (n, nv) array
            Dimensionless rates: slides divided by the characteristic length. Floating bodies along
            the axes of the frame that they float in.
        """
        m = self.mechanism
        if not m.rows:
            return self._own_axes(q, wanted) * m.column_scale
        found = np.empty_like(wanted)
        for a in range(0, len(q), CHUNK):
            part = slice(a, a + CHUNK)
            found[part] = self._projected(q[part], wanted[part])
        return self._own_axes(q, found) * m.column_scale

    def _projected(self, q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        nv = self.mechanism.model.nv
        numbers = self._code.run(np.ascontiguousarray(q.T))
        basis = numbers[1:].reshape(nv, -1, len(q)).transpose(2, 0, 1)
        fine = (np.abs(numbers[0]) > PIVOT) & (np.abs(numbers[1:]).max(axis=0, initial=0.0) < LARGE)
        basis = np.where(fine[:, None, None], basis, 0.0)
        gram = basis.swapaxes(1, 2) @ basis
        gram[~fine] = np.eye(gram.shape[1])
        inner = basis.swapaxes(1, 2) @ wanted[:, :, None]
        found = (basis @ np.linalg.solve(gram, inner))[:, :, 0]
        for i in np.flatnonzero(~fine):
            found[i] = self._by_lapack(q[i], wanted[i])
        return np.asarray(found)

    def _by_lapack(self, q: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        m = self.mechanism
        rank = sampled_rank(m).rank.value
        turned = self._own_axes(q[None], wanted[None])[0]
        basis = kernel(dimensionless_jacobian(m, q), m.model.nv - rank)
        return self._own_axes(q[None], (basis @ (basis.T @ turned))[None], back=True)[0]

    def _own_axes(self, q: np.ndarray, v: np.ndarray, *, back: bool = False) -> np.ndarray:
        """Rates of floating bodies along their own axes, as Pinocchio has them; or back."""
        model, found = self.mechanism.model, np.array(v)
        for joint in list(model.joints)[1:]:
            if joint.nv != 6:
                continue
            x, y, z, w = q[:, joint.idx_q + 3 : joint.idx_q + 7].T
            turn = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
            letters = "ijn,nj->ni" if back else "jin,nj->ni"
            for first in (joint.idx_v, joint.idx_v + 3):
                three = slice(first, first + 3)
                found[:, three] = np.einsum(letters, turn, v[:, three])
        return found

    @cached_property
    def _code(self) -> Compiled:
        """Smallest pivot, then a basis (nv, f) of the closed motions, row by row."""
        g, m = Graph(), self.mechanism
        closures, zero = problem_of(m).eliminated(g), g.constant(0.0)
        least, basis = closures.factors.least, closures.basis
        entries = [g.lift(motion.get(v, zero)) for v in range(m.model.nv) for motion in basis]
        return compiled(g.tape([g.lift(least), *entries], m.model.nq))


def random_motions(mechanism: Mechanism) -> RandomMotions:
    """The projection of a mechanism, made once."""
    found: RandomMotions = mechanism.known.setdefault("forces.motions", RandomMotions(mechanism))
    return found
