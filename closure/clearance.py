"""How far postures are from where the coordinates that are held no longer fix them.

The least singular value of the map from closed motions to the rates of these coordinates, motions
measured by the rates of all physical joints: with the inputs held it is ``sigma_direct``, with the
task's outputs ``sigma_inverse``.
"""

from __future__ import annotations

import numpy as np

from closedchain.closure.chart import Chart
from closedchain.closure.generic import dimensionless_jacobian, dimensionless_task
from closedchain.closure.joint_rates import orthonormal_motions, physical_rates
from closedchain.closure.ranks import null_space


def clearance(chart: Chart, q: np.ndarray) -> float:
    """Least rate of a chart's coordinates in a unit closed motion at ``q`` (nq,), dimensionless.

    0 where the closures leave more motions than the chart has coordinates.
    """
    m = chart.mechanism
    basis, _ = null_space(dimensionless_jacobian(m, q))
    motions = orthonormal_motions(basis, physical_rates(m, q))
    rates = np.vstack([motions[chart.pinned_v], dimensionless_task(m, q, chart.outputs) @ motions])
    if motions.shape[1] > rates.shape[0]:
        return 0.0
    values = np.linalg.svd(rates, compute_uv=False)
    return float(values[motions.shape[1] - 1]) if values.size else 0.0
