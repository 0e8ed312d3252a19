"""Which robots there are, where their description lies, and what their variants change."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from math import radians
from pathlib import Path
from types import MappingProxyType

from closedchain.closure import Mechanism, mechanism_from_description
from closedchain.closure.files import load_file
from closedchain.closure.loading import refuse_open
from closedchain.robots.classics import CLASSICS
from closedchain.robots.delia_choices import CHOICES as DELIA_LEGS
from closedchain.robots.entry import Overrides, Robot
from closedchain.robots.examples import PREFIX, example_file
from closedchain.urdf import load_description
from closedchain.urdf.description import ParameterValue
from closedchain.urdf.errors import DescriptionError, known_names

_D1 = Robot(
    name="d1",
    title="D1 of the DeLiA family (list --family delia): 3-RPS + 3-RPS + 3-UPS, six inputs",
    source="J. Gallardo-Alvarado, DeLiA: a new family of redundant robot manipulators, 2010",
    file="d1.xacro",
    up="y",
    variants=MappingProxyType(
        {
            "corrected": {},
            # U1 and U2 as the paper prints them; it does not print U3: mirrored
            "printed_u": {
                "U1": "0.5 -0.25 0",
                "U2": "-0.215 -0.25 -0.337",
                "U3": "-0.215 -0.25 0.337",
            },
            # U1 moved onto the circle on which U2 lies
            "circle_u": {"U2": "-0.215 -0.25 -0.337", "U3": "-0.215 -0.25 0.337"},
        }
    ),
)
_ECLIPSE_PAPER = (
    "H. Simas, A. Dias, D. Martins, Kinematic model for Eclipse and Eclipse-II parallel robot"
)
_ECLIPSE = Robot(
    name="eclipse",
    title="Eclipse: three PPRS legs with columns on a circular guide, six inputs",
    source=_ECLIPSE_PAPER,
    file="eclipse.xacro",
)
_ECLIPSE2 = Robot(
    name="eclipse2",
    title="Eclipse-II: Eclipse with a vertical circular guide in leg a, six inputs",
    source=_ECLIPSE_PAPER,
    file="eclipse2.xacro",
)
_RUS6 = Robot(
    name="rus6",
    title="Reconfigurable 2(3-RUS): six arms and the angle of three reconfiguration links",
    source="R. E. Sanchez-Alonso, An application of screw theory for the identification of "
    "singularities in a novel reconfigurable parallel robot, Nexo 29(2), 2016",
    file="rus6.xacro",
    up="y",
    variants=MappingProxyType(
        {
            "coupled": {},
            "free": {"reconfiguration": "free"},
            "locked": {"reconfiguration": "locked"},
            # sizes of ours at which the singularity of figure 5 occurs; home moved into reach
            "figure5": {"LA": 0.25, "LB": 0.25, "r": 0.12, "H": 0.05, "height": -0.3},
        }
    ),
)
_RPA3T = Robot(
    name="rpa3t",
    title="RPa(3R)2R+RPa: three translations, two parallelograms, three inputs",
    source="H. Shen et al., Topological design of an asymmetric 3-translational parallel "
    "mechanism with zero coupling degree and motion decoupling, 2018",
    file="rpa3t.xacro",
    variants=MappingProxyType(
        {
            "case_study": {},
            # inputs within which the regular box of docs/robots/rpa3t.md lies
            "working": {
                "theta1_range": f"{radians(-60)} {radians(10)}",
                "theta2_range": f"{radians(110)} {radians(230)}",
                "theta3_range": f"{radians(-60)} {radians(65)}",
            },
        }
    ),
)
_LINEAR_DELTA = Robot(
    name="linear_delta",
    title="Linear Delta 3-PRPaR: three vertical sliders, three translations",
    source="K. Z. Zenebe, Formulation of a generalized Jacobian and inverse acceleration analysis "
    "of a linear Delta manipulator ..., IJERT 2(2), 2013",
    file="linear_delta.xacro",
    variants=MappingProxyType(
        {
            "default": {},
            # rails for the trajectories V1 and V2 of robots.linear_delta, home at their start
            "V1": {
                "home": "-0.10132118364233778 0 -0.6",
                "rail_lower": -0.3,
                "rail_upper": 2.0,
            },
            "V2": {
                "home": "-0.15831434944115277 0 -0.6",
                "rail_lower": -0.3,
                "rail_upper": 0.2,
            },
        }
    ),
)
_DELIA = Robot(
    name="delia",
    title="DeLiA family: a driven and a passive three-leg stage and three driven outer legs",
    source=_D1.source,
    file="delia.xacro",
    up="y",
    variants=_D1.variants,
    choices=DELIA_LEGS,
)
_GROUPS: Mapping[str, tuple[Robot, ...]] = MappingProxyType(
    {
        "papers": (_D1, _ECLIPSE, _ECLIPSE2, _RPA3T, _LINEAR_DELTA, _RUS6),
        "classics": CLASSICS,
    }
)
_CATALOGUE: Mapping[str, Robot] = MappingProxyType(
    {r.name: r for group in _GROUPS.values() for r in group}
)
_FAMILIES: Mapping[str, Robot] = MappingProxyType({r.name: r for r in (_DELIA,)})


def robots(group: str | None = None) -> tuple[str, ...]:
    """Names of the robots in the catalogue; families are listed by ``families()``.

    With a group, of that group alone: ``"papers"`` are the robots whose papers are worked through,
    with closed forms of their own; ``"classics"`` are well-known mechanisms. Raises
    ``DescriptionError`` for an unknown group.

    Examples
    --------
    >>> "d1" in cc.robots()
    True
    """
    if group is None:
        return tuple(_CATALOGUE)
    if group not in _GROUPS:
        raise DescriptionError(known_names(group, "group of robots", _GROUPS))
    return tuple(entry.name for entry in _GROUPS[group])


def groups() -> tuple[str, ...]:
    """Groups of robots, which ``robots`` takes."""
    return tuple(_GROUPS)


def families() -> tuple[str, ...]:
    """Names of the families, which ``load`` takes too."""
    return tuple(_FAMILIES)


def family(name: str) -> Robot:
    """Catalogue entry of a family. Raises ``DescriptionError`` for an unknown name."""
    try:
        return _FAMILIES[name]
    except KeyError:
        raise DescriptionError(known_names(name, "family", _FAMILIES)) from None


def robot(name: str) -> Robot:
    """Catalogue entry of a robot or family. Raises ``DescriptionError`` for an unknown name."""
    everything = {**_CATALOGUE, **_FAMILIES}
    try:
        return everything[name]
    except KeyError:
        raise DescriptionError(known_names(name, "robot", everything)) from None


def load(name: str, *, variant: str | None = None, **parameters: ParameterValue) -> Mechanism:
    """Load a robot of the catalogue.

    Parameters
    ----------
    name : str
        One of ``robots()`` or ``families()``; or ``example:NAME`` for a robot of the package
        example-robot-data (extra ``closedchain[examples]``).
    variant : str, optional
        A named set of parameters of that robot.
    parameters : numbers or strings
        Sizes [m], and for a family its choices, as listed in ``Mechanism.parameters``; they
        override the variant's.

    Raises
    ------
    DescriptionError
        Unknown robot, variant, parameter or choice (lists the known ones), or sizes that do not
        close.

    Examples
    --------
    >>> cc.load("linear_delta").name
    'linear_delta'
    >>> round(float(cc.load("linear_delta", b=0.6).parameters["b"]), 3)  # longer rods
    0.6
    """
    if name.startswith(PREFIX):
        if variant is not None or parameters:
            raise DescriptionError(f"{name} has neither variants nor parameters")
        return load_file(example_file(name))
    if name not in (*robots(), *families()) and (Path(name).suffix or Path(name).name != name):
        raise DescriptionError(
            f"{name!r} is no robot of the catalogue; files are loaded by cc.load_file({name!r})"
        )
    entry = robot(name)
    overrides: Overrides = {}
    if variant is not None:
        if variant not in entry.variants:
            raise DescriptionError(known_names(variant, f"variant of {name}", entry.variants))
        overrides = entry.variants[variant]
    given = {**overrides, **parameters}
    for parameter, choice in entry.choices.items():
        if parameter in given:
            choice.check(parameter, given[parameter])
    path = files("closedchain.urdf") / entry.file
    return refuse_open(mechanism_from_description(load_description(str(path), given), 0.0))
