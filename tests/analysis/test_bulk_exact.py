"""Measures in bulk: the bits of a posture are its own; higher ranks, open postures, the table."""

from __future__ import annotations

import threading

import linkages
import numpy as np
import pytest
from oracle.walks import closed

import closedchain as cc
from closedchain.analysis.singularity.bulk.measuring import CHUNK, bulk_measures
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.analysis.singularity.measures_table import (
    MEASURES,
    Postures,
    chosen,
    evaluated,
)
from closedchain.closure.generic import dimensionless_jacobian, sampled_rank
from closedchain.closure.ranks import numerical_rank


@pytest.fixture(scope="module")
def postures() -> tuple[cc.Mechanism, np.ndarray]:
    m = cc.load("linear_delta")
    return m, closed(m, 9)


def test_bits_do_not_depend_on_neighbours(postures: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, q = postures
    bulk = bulk_measures(m)
    alone = [bulk.measures(one[None]) for one in q]
    many = np.tile(q, (CHUNK // len(q) + 3, 1))[::-1]
    together, plain = bulk.measures(many), bulk.determinants(many)
    for name, values in together.items():
        expected = np.array([found[name][0] for found in alone])
        for i, value in enumerate(values[::-1]):
            assert value == expected[i % len(q)], (name, i)
    lone = [bulk.determinants(one[None]) for one in q]
    for name, values in plain.items():
        expected = np.array([found[name][0] for found in lone])
        assert (values[::-1][: len(q)] == expected).all()


def test_threads_share_the_code(postures: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, q = postures
    bulk, many = bulk_measures(m), np.tile(q, (60, 1))
    expected = bulk.measures(many)
    found: list[dict[str, np.ndarray]] = []
    threads = [threading.Thread(target=lambda: found.append(bulk.measures(many))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for one in found:
        assert all((one[name] == values).all() for name, values in expected.items())


@pytest.mark.slow
def test_postures_where_redundant_rows_are_not() -> None:
    """Far from home rpa3t closes in postures where one row more counts than is generic."""
    m = cc.load("rpa3t")
    rank = sampled_rank(m).rank.value
    q = closed(m, 60, 5, 0.8)
    higher = [numerical_rank(dimensionless_jacobian(m, one)).value > rank for one in q]
    assert any(higher)
    found, expected = bulk_measures(m).measures(q), measures_at(m, q, m.outputs())
    for name in ("sigma_direct", "sigma_inverse", "sigma_constraint", "det_direct", "det_inverse"):
        off = np.abs(found[name] - expected[name])
        assert (off <= 1e-9 * np.abs(expected[name]) + 1e-12).all(), name


def test_open_postures_are_refused(postures: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, q = postures
    wrong = q.copy()
    wrong[3, 0] += 1e-3
    for evaluate in (bulk_measures(m).measures, bulk_measures(m).determinants):
        with pytest.raises(cc.ClosureError, match="not closed"):
            evaluate(wrong)


def test_no_postures_have_no_measures(postures: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, q = postures
    found = bulk_measures(m).measures(q[:0])
    assert set(found) == set(MEASURES)
    assert all(values.shape == (0,) for values in found.values())


def test_the_table_takes_functions(postures: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, q = postures

    def height(mechanism: cc.Mechanism, many: np.ndarray) -> np.ndarray:
        """Height of the tip [m]."""
        return np.array([mechanism.pose(one).translation[2] for one in many])

    at = Postures(m, q, m.outputs())
    found = evaluated(at, chosen(["det_direct", height, "sigma_direct"]))
    assert list(found) == ["det_direct", "height", "sigma_direct"]
    assert (found["height"] == height(m, q)).all()
    expected = measures_at(m, q, m.outputs())
    np.testing.assert_allclose(found["sigma_direct"], expected["sigma_direct"], rtol=1e-9)
    assert chosen([height])[0].long_name == "Height of the tip [m]"
    with pytest.raises(cc.ClosureError, match="did you mean 'sigma_direct'"):
        chosen(["sigma_dirct"])
    with pytest.raises(cc.ClosureError, match="same name"):
        chosen([height, height])
    with pytest.raises(cc.ClosureError, match="one number for each"):
        evaluated(at, chosen([lambda mechanism, many: np.zeros(2)]))


def test_measures_that_are_not_defined_are_left_out() -> None:
    m = linkages.rods()
    at = Postures(m, closed(m, 2, 0, 0.1), m.outputs())
    assert "det_direct" not in evaluated(at, MEASURES.values())
