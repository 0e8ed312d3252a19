"""Plain text of the closed forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

_WIDE = 400


def report(name: str, parts: Any, legend: Mapping[Any, Any], assumptions: Sequence[str]) -> str:
    """One paragraph a leg, then the platform, the symbols, and what is taken for granted."""
    lines = [f"{name}: screws (angular; linear), one column for each freedom, unit rates."]
    for number, leg in enumerate(parts.legs, 1):
        lines.append(f"  leg {number}, {leg.start} to {leg.end}: {' '.join(leg.joints)}")
        if leg.determinant is not None:
            lines.append(f"    determinant {_shown(leg.determinant)}")
            lines += _factors(leg.factors)
        else:
            lines.append(f"    no determinant: {leg.reason}")
        for which, lever in leg.levers.items():
            lines.append(f"    Jq, {which}: {_shown(lever)}")
            lines += _factors(f for f in leg.lever_factors[which] if f.role != "scale")
    for title, found in (
        ("det Jq", parts.det_Jq),
        ("det Jx", parts.det_Jx),
        ("outputs", parts.det_output),
        ("virtual chain px py pz rx ry rz", parts.chain),
    ):
        if found is None:
            continue
        lines.append(f"  {title}: {_shown(found.expr) if found.expr is not None else found.note}")
        if title != "det Jq":
            lines += _factors(found.factors)
    lines.append("  symbols:")
    lines += [f"    {s} [{m.unit}]: {m.text}" for s, m in legend.items()]
    if assumptions:
        lines.append("  taken for granted:")
        lines += [f"    {a}" for a in assumptions]
    return "\n".join(lines)


def _factors(factors: Any) -> list[str]:
    return [
        f"      {_shown(f.expr)}{f' ^{f.exponent}' if f.exponent != 1 else ''}"
        f" ({f.role}): {f.meaning}"
        for f in factors
        if f.role != "scale"
    ]


def _shown(expr: Any) -> str:
    text = str(expr)
    return text if len(text) <= _WIDE else f"{text[:_WIDE]}..."
