"""The tests that the ledgers name would notice a wrong implementation: another few each day.

All of them with ``CLOSEDCHAIN_LEDGERS=all``, or ``python tests/ledger_perturbed.py``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from ledger_perturbed import SIZE, claims, perturbed

HERE = Path(__file__).parent
FEW = 4


@pytest.mark.slow
def test_tests_named_in_the_ledgers_notice() -> None:
    """In processes of their own, each with one implementation perturbed by a part in a thousand."""
    everything = os.environ.get("CLOSEDCHAIN_LEDGERS") == "all"
    chosen = [] if everything else [str(FEW), date.today().isoformat()]
    done = subprocess.run(
        [sys.executable, str(HERE / "ledger_perturbed.py"), *chosen],
        capture_output=True,
        text=True,
        timeout=None if everything else 300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    count = len(claims()) if everything else FEW
    assert done.stdout.splitlines()[-1] == f"{count} of {count} tests notice"


def test_there_are_claims_of_every_ledger() -> None:
    assert {claim.ledger for claim in claims()} >= {"d1", "eclipse", "linear_delta", "rpa3t"}
    assert len(claims()) > 100


def test_numbers_are_perturbed_by_a_part_in_a_thousand() -> None:
    array = np.array([3.0, -2.0, 0.0, 1e-14])
    found = perturbed((array, 2.0, 5, True, "text", frozenset({"direct", "inverse"})))
    off = np.abs(found[0] - array) / [3.0, 2.0, 3.0, 3.0]
    assert (off > 0.1 * SIZE).all()
    assert (off <= SIZE * 1.01).all()
    assert len(set(off.round(9))) == 4  # no two alike
    assert 0.1 * SIZE < abs(found[1] - 2.0) / 2.0 <= SIZE
    assert found[2:] == (6, True, "text", frozenset({"inverse"}))
