"""Curves of a slice traced from seeds, each one once, with the curves that branch off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from closedchain.analysis.singularity.sets.dimension import dimensions
from closedchain.analysis.singularity.sets.edges import Edges, on_edges
from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.membership import reached
from closedchain.analysis.singularity.sets.seeds import Seed, least_values, seed_on
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.branching import leaving
from closedchain.closure.solve.joining import both_ways
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import Bound, settle, tangents

POSTURE_STEP = 0.2  # dimensionless: largest change of an unknown of the posture in a step
CELL_STEP = 0.5  # cells: largest change of a coordinate in a step
NEAR = 0.1  # of a chord: a point nearer to it than this lies on the curve
MOST_CURVES = 200
MOST_RANKS = 3  # that are looked for together
ALIKE = 5.0  # of the least singular value: others up to there may vanish with it
SMALL = 0.1  # of the largest one: if they are below that
UPRIGHT = 1e-4  # share of the coordinates in a direction that leaves them alone
VANISHED = 1e-7  # of the largest singular value, at a solution
BLURRED = 1e-4  # dimensionless: from a solution to a constraint singularity that it stands for
BESIDE = 1e-2  # dimensionless: from a solution to where more ranks are lost
SAME = 1e-3  # dimensionless: branch points nearer to each other than this are one


@dataclass(frozen=True, eq=False)
class Curve:
    """Points (n, nq + k) of a curve, how it begins and ends, indices of its branch points."""

    points: np.ndarray
    ends: tuple[str, str]
    crossings: tuple[int, ...]


@dataclass(eq=False)
class Tracker:
    """Traces the curves of a system over a lattice, and knows those that it has.

    Attributes
    ----------
    finer : Lattice, optional
        The same branch on a finer grid, where that is known.
    curves : list of Curve
    points : list of arrays
        Solutions that lie on no curve: isolated ones.
    flat : list of arrays
        Solutions at which the equations are degenerate.
    crossings : list of arrays
        Branch points.
    degenerate : int
        Dimension of the set where it is larger than that of a curve; else 0.
    above : int
        Dimension of the largest set of postures with the same coordinates that was met.
    dropped : int
        Bracketed seeds near which no solution was found.
    tried, lost : int
        Least values that were started from, and those from which no solution was reached.
    inner : dict
        Trackers of what was met besides: where a matrix loses more ranks, by how many each one
        loses, and where the closures themselves do, by "constraint".
    """

    system: Slice
    lattice: Lattice
    finer: Lattice | None = None
    curves: list[Curve] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    flat: list[np.ndarray] = field(default_factory=list)
    crossings: list[np.ndarray] = field(default_factory=list)
    degenerate: int = 0
    above: int = 0
    dropped: int = 0
    tried: int = 0
    lost: int = 0
    inner: dict[tuple[int, ...] | str, Tracker] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Lay out bounds and step lengths."""
        chart, model = self.system.chart, self.system.mechanism.model
        self.bounds = [
            Bound(model.nq + i, model.nv + i, s, float(v[0]), float(v[-1]), Ending.EDGE.word)
            for i, (s, v) in enumerate(zip(chart.scale, self.lattice.values, strict=True))
        ]
        lower, upper = self.system.mechanism.limits
        self.bounds += [
            Bound(
                joint.idx_q,
                joint.idx_v,
                float(self.system.mechanism.column_scale[joint.idx_v]),
                float(lower[joint.idx_q]),
                float(upper[joint.idx_q]),
                f"limit of joint {model.names[joint.id]}",
                Ending.LIMIT,
            )
            for joint in list(model.joints)[1:]
            if joint.nq == 1 and np.isfinite([lower[joint.idx_q], upper[joint.idx_q]]).any()
        ]
        steps = CELL_STEP * self.lattice.cell / chart.scale
        self.longest = np.concatenate([np.full(model.nv, POSTURE_STEP), steps])

    @property
    def branch(self) -> list[Lattice]:
        """The branch, on every grid on which it is known."""
        return [self.lattice] if self.finer is None else [self.lattice, self.finer]

    # -- seeds -----------------------------------------------------------------------------------

    def polished(self, seed: Seed) -> np.ndarray | None:
        """Solution near a seed, or None.

        Where the seed is bracketed along an axis, the other coordinates are held first, so that
        the posture cannot slide along the set.
        """
        for cell in (seed.cell, *seed.others):
            z = self._polished_from(cell, seed)
            if z is not None:
                return z
        return None

    def _polished_from(self, cell: tuple[int, ...], seed: Seed) -> np.ndarray | None:
        lattice = self.lattice
        k = len(self.system.chart.names)
        start = self.system.point(lattice.q[cell], lattice.place(np.array([cell]))[0])
        others = [] if seed.axis is None else [i for i in range(k) if i != seed.axis]
        held = [(self.bounds[i], float(start[self.bounds[i].index])) for i in others]
        tries = [(self.system, held)] if held and self.system.codimension == 1 else []
        tries.append((self.system, []))
        tries += [(self.system.losing(c), []) for c in self._alike(start)]
        for system, rows in tries:
            found = settle(system, start, rows, careful=bool(seed.others))
            z = found.posture
            if not found.good or (
                seed.others and any(b.beyond(z) is not None for b in self.bounds)
            ):
                continue
            moved = (self.system.coordinates(z) - seed.place) / lattice.cell
            if np.linalg.norm(moved) <= seed.reach and self.system.residual(z) < 1e-11:
                return z
        return None

    def _alike(self, z: np.ndarray) -> list[tuple[int, ...]]:
        """Numbers of ranks that might be lost together near a point: values of the same order."""
        found = []
        for n, measure in enumerate(self.system.measures):
            s = self.system.values(z)[n][::-1]
            for k in range(measure.corank + 1, min(MOST_RANKS, s.size - 1) + 1):
                if s[k - 1] <= ALIKE * s[0] and s[k - 1] <= SMALL * s[-1]:
                    more = list(self.system.coranks)
                    more[n] = k
                    found.append(tuple(more))
        return found

    def located(self, kind: str, lattice: Lattice, edges: Edges) -> np.ndarray:
        """Solutions (n, nq + k) on or near edges of a lattice; NaN where there is none."""
        found = on_edges(self.system, lattice, kind, edges)
        mine, self.lattice = self.lattice, lattice
        for i in np.flatnonzero(np.isnan(found[:, 0])):
            z = self.polished(seed_on(lattice, kind, edges, int(i)))
            if z is not None:
                found[i] = z
        self.lattice = mine
        return found

    def least(self, kind: str, lattice: Lattice, *, wide: bool) -> Iterator[None]:
        """Trace from the least values of a lattice; yield after each."""
        mine, seeds = self.lattice, least_values(lattice, kind, wide=wide)
        for seed in seeds:
            self.lattice = lattice
            z = self.polished(seed)
            self.lattice = mine
            self.lost += z is None
            self.tried += 1
            if z is not None:
                self.add(z)
            yield

    def follow(self, points: Iterable[np.ndarray | None]) -> Iterator[None]:
        """Trace the curves on which solutions lie, and those that branch off; yield after each."""
        for z in points:
            if z is not None and np.isfinite(z[0]):
                self.add(z)
            yield

    def add(self, z: np.ndarray) -> None:
        """Trace the curve through a solution, unless it is known; then those that branch off."""
        pending = [z]
        while pending and len(self.curves) < MOST_CURVES:
            z = pending.pop()
            if any(b.beyond(z) is not None for b in self.bounds) or self.knows(z):
                continue
            curve = self._curve(z)
            if curve is None:
                continue
            self.curves.append(curve)
            for i in curve.crossings:
                crossing = curve.points[i]
                if any(self._gap(crossing, other) < SAME for other in self.crossings):
                    continue
                self.crossings.append(crossing)
                if not reached(self.system, self.branch, crossing[None])[0]:
                    continue
                near = [curve.points[j] for j in (i - 1, i + 1) if 0 <= j < len(curve.points)]
                radius = min((self._gap(crossing, n) for n in near), default=0.0)
                radius = min(max(radius, 1e-3), 0.5 * float(self.longest.min()) + 1e-3)
                pending.extend(leaving(self.system, crossing, radius))

    def _gap(self, one: np.ndarray, two: np.ndarray) -> float:
        return float(np.linalg.norm(self.system.difference(one, two)))

    def _curve(self, z: np.ndarray) -> Curve | None:
        if self._constrained(z):
            return None
        more = self._more_lost(z)
        if more and self._together(z):
            return None
        try:
            basis = tangents(self.system, z)
        except np.linalg.LinAlgError:  # more ranks are lost than the borders make up for
            self.flat.append(z)
            return None
        if basis.shape[1] == 0 and not more:
            self.points.append(z)
            return None
        if basis.shape[1] != 1:
            self._flat(z, basis)
            return None
        found = both_ways(self.system, z, basis[:, 0], self.longest, self.bounds)
        return Curve(np.array(found.points), found.ends, found.crossings)

    def _flat(self, z: np.ndarray, basis: np.ndarray) -> None:
        """Note a solution with degenerate equations, and the dimension of the set around it."""
        self.flat.append(z)
        whole, seen = dimensions(self.system, z, basis)
        # at a crossing, steps along several curves look like more than they are: a self-motion
        # also needs directions that leave the coordinates alone
        shares = np.linalg.svd(basis[self.system.mechanism.model.nv :], compute_uv=False)
        upright = basis.shape[1] - int(np.count_nonzero(shares > UPRIGHT))
        self.above = max(self.above, min(whole - seen, upright))
        if seen < len(self.system.chart.names):  # else every posture were singular
            self.degenerate = max(self.degenerate, seen)

    def _more_lost(self, z: np.ndarray) -> tuple[int, ...]:
        """Ranks that are lost at a solution, where these are more than sought; else none."""
        lost = self.system.lost(z, VANISHED)
        both = list(zip(lost, self.system.coranks, strict=True))
        if all(n <= own for n, own in both):
            return ()
        return tuple(max(n, own) for n, own in both)

    def _together(self, z: np.ndarray) -> bool:
        """Trace the curve along which more ranks are lost at once, where a solution lies on one.

        Where the loss of more ranks is isolated, curves of a smaller loss may still pass.
        """
        coranks = self._more_lost(z)
        if self.system.unfold or max(coranks) > MOST_RANKS:
            return False
        inner = self.inner.get(coranks) or Tracker(
            self.system.losing(coranks), self.lattice, self.finer
        )
        found = settle(inner.system, z)
        settled = found.posture
        if not found.good or self._gap(z, settled) > BESIDE:
            return False
        if not inner.knows(settled):
            try:
                dimension = tangents(inner.system, settled).shape[1]
            except np.linalg.LinAlgError:
                return False
            if dimension != 1:
                return False
            inner.add(settled)
            self.inner[coranks] = inner
        return True

    def _constrained(self, z: np.ndarray) -> bool:
        """Trace the constraint singularities through a solution, where it is one.

        The closures lose rank there, and with them every matrix that holds them: the kind's own
        equations are degenerate, those of the constraint singularity are not.
        """
        measure = replace(self.system.measures[0], kind="constraint", corank=1)
        if self.system.unfold or not min(measure.shape):
            return False
        s = np.linalg.svd(self.system.at(z).closures, compute_uv=False)
        if s[min(measure.shape) - 1] > BLURRED * s[0]:
            return False
        inner = self.inner.get("constraint")
        if inner is None:
            inner = Tracker(Slice(self.system.chart, (measure,)), self.lattice, self.finer)
        # where branches meet, rounding of the closures lets a posture be off by its root
        found = settle(inner.system, z)
        if not found.good or self._gap(z, found.posture) > BLURRED:
            return False
        self.inner["constraint"] = inner
        inner.add(found.posture)
        return True

    def knows(self, z: np.ndarray) -> bool:
        """Whether a solution is a point, or lies on a curve, that was found."""
        nq = self.system.mechanism.model.nq
        for curve in self.curves:
            apart = np.abs(curve.points[:, nq:] - z[nq:]) / self.lattice.cell
            for i in np.flatnonzero((apart < 0.8 + CELL_STEP).all(axis=1)):
                if self._beside(curve, int(i), z):
                    return True
        if any(inner.knows(z) for inner in self.inner.values()):
            return True
        return any(self._gap(z, other) < 1e-6 for other in self.points)

    def linked(self) -> list[Curve]:
        """The curves, each with all branch points that it passes, whichever curve showed them."""
        own = [self._with_crossings(curve) for curve in self.curves]
        return own + [curve for inner in self.inner.values() for curve in inner.linked()]

    def alone(self) -> list[np.ndarray]:
        """Solutions that lie on no curve, of all trackers."""
        return self.points + [z for inner in self.inner.values() for z in inner.alone()]

    def _with_crossings(self, curve: Curve) -> Curve:
        nq = self.system.mechanism.model.nq
        for crossing in self.crossings:
            own = [curve.points[i] for i in curve.crossings]
            if any(self._gap(crossing, other) < SAME for other in own):
                continue
            apart = np.abs(curve.points[:, nq:] - crossing[nq:]) / self.lattice.cell
            near = np.flatnonzero((apart < 0.8 + CELL_STEP).all(axis=1))
            beside = [int(i) for i in near if self._beside(curve, int(i), crossing)]
            if not beside:
                continue
            i = min(beside, key=lambda j: self._gap(curve.points[j], crossing)) + 1
            points = np.insert(curve.points, i, crossing, axis=0)
            later = tuple(j + (j >= i) for j in curve.crossings)
            curve = Curve(points, curve.ends, tuple(sorted((*later, i))))
        return curve

    def _beside(self, curve: Curve, i: int, z: np.ndarray) -> bool:
        """Whether a solution lies on the chord from point i of a curve to the next."""
        here = curve.points[i]
        following = (
            i + 1
            if i + 1 < len(curve.points)
            else (0 if curve.ends[0] == Ending.CLOSED.word else i)
        )
        gap = self.system.difference(here, z)
        size = float(np.linalg.norm(gap))
        if size < 1e-6:
            return True
        chord = self.system.difference(here, curve.points[following])
        length = float(np.linalg.norm(chord))
        if length == 0.0 or size > 1.5 * length:
            return False
        share = float(gap @ chord) / length**2
        if not -0.05 <= share <= 1.05:
            return False
        return float(np.linalg.norm(gap - share * chord)) < NEAR * length
