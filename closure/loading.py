"""From a file to a mechanism: read, taken for what its rounded numbers mean, closed at home."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from closedchain.closure.assembly import Assembled, assembled, moved
from closedchain.closure.build import as_stated, length_at
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rounding.verdict import meant
from closedchain.urdf.description import Description, ParameterValue
from closedchain.urdf.errors import ClosureError, DescriptionError, known_names
from closedchain.urdf.meshes import with_mesh_paths

JointValue = float | Sequence[float]

MOVED = 1e-6  # m or rad that home may be from where it is stated without a word


def load_urdf(
    source: str | os.PathLike[str],
    tolerance: float | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    home: Mapping[str, JointValue] | ParameterValue | None = None,
    *,
    xacro: bool = True,
    **parameters: ParameterValue,
) -> Mechanism:
    """Load a closed-chain mechanism from a URDF or xacro file, or from its text.

    A xacro file is code: it evaluates Python expressions. ``xacro=False`` reads plain URDF only
    and is there for text that is not trusted.

    Parameters
    ----------
    source : path or str
        A file, or the text itself (it begins with ``<``).
    tolerance : float, optional
        How much rounded numbers may leave open [m]; angles times the characteristic length. By
        default ten units of the coarsest last printed digit; 0 takes every number as it stands.
    package_dirs : sequence of paths
        Folders that hold the packages of ``package://`` meshes; ROS_PACKAGE_PATH is searched too.
    home : mapping of joint or input to value, optional
        Values [m, rad] that replace those of the stated home; of a floating joint seven, x y z and
        a quaternion x y z w. What is no mapping is the value of a ``<xacro:arg name="home">``.
    parameters : numbers, strings or booleans
        Values for the file's ``<xacro:arg>``.

    Returns
    -------
    Mechanism
        ``notes`` say what was read over or assumed. Where no closed home is found ``home_open``
        is true.

    Raises
    ------
    DescriptionError
        Anything wrong with the file or the parameters, with line, element and name.

    Examples
    --------
    >>> text = '''
    ... <robot name="press">
    ...   <link name="base"/> <link name="crank"/> <link name="rod"/> <link name="ram"/>
    ...   <joint name="A" type="continuous">
    ...     <parent link="base"/> <child link="crank"/> <axis xyz="0 0 1"/> </joint>
    ...   <joint name="B" type="continuous">
    ...     <parent link="crank"/> <child link="rod"/> <origin xyz="0.1 0 0"/> <axis xyz="0 0 1"/>
    ...   </joint>
    ...   <joint name="S" type="prismatic">
    ...     <parent link="base"/> <child link="ram"/> <axis xyz="1 0 0"/>
    ...     <limit lower="0" upper="1" effort="1" velocity="1"/> </joint>
    ...   <constraint name="C" type="revolute">
    ...     <parent link="rod"/> <parent_origin xyz="0.3 0 0"/> <parent_axis xyz="0 0 1"/>
    ...     <child link="ram"/> </constraint>
    ...   <transmission name="motor"> <joint name="A"/> </transmission>
    ...   <group_state name="home"> <joint name="A" value="1.0"/> <joint name="B" value="-1.3"/>
    ...     <joint name="S" value="0.34"/> </group_state>
    ... </robot>'''
    >>> m = cc.load_urdf(text)
    >>> ram = 0.1 * np.cos(0.5) + np.sqrt(0.3**2 - (0.1 * np.sin(0.5)) ** 2)  # by trigonometry
    >>> bool(abs(cc.direct(m, {"motor": 0.5}).q[2] - ram) < 1e-12)
    True
    """
    from closedchain.urdf import load_description

    if home is not None and not isinstance(home, Mapping):
        parameters, home = {**parameters, "home": home}, None
    description = load_description(source, parameters, xacro=xacro)
    return mechanism_from_description(located(description, source, package_dirs), tolerance, home)


def located(
    description: Description,
    source: str | os.PathLike[str],
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> Description:
    """The same description with the places where its meshes are looked for.

    ``source`` is the file that it was read from, or text.
    """
    name = os.fsdecode(source)
    is_text = name.lstrip("\ufeff \t\r\n").startswith("<")
    return replace(
        description,
        folder=None if is_text else os.path.dirname(os.path.abspath(name)),
        package_dirs=tuple(os.fsdecode(folder) for folder in package_dirs),
    )


def mechanism_from_description(
    description: Description,
    tolerance: float | None = None,
    home: Mapping[str, JointValue] | None = None,
) -> Mechanism:
    """Build the mechanism that a description describes and close its home posture.

    ``tolerance`` and ``home`` as for ``load_urdf``. Where no closed home is found, home is where
    descent from the stated one ends, and ``home_open`` is true.

    Raises
    ------
    DescriptionError
        A joint of ``home`` that is unknown, or another number of values than it has.
    """
    if tolerance is not None and not 0.0 <= tolerance < np.inf:
        raise DescriptionError(f"tolerance must be a length in m, not below 0, got {tolerance!r}")
    if home:
        description = replace(description, home={**description.home, **_given(description, home)})
    mechanism, rounding, doubts = meant(as_stated, as_stated(description), tolerance)
    stated = mechanism.home
    # the length of the stated posture closes home, whose own length then holds
    found = assembled(mechanism)
    assumed = doubts if rounding is None else (rounding.text, *doubts)
    _, missing = with_mesh_paths(description)
    closed = mechanism.with_home(found.q, length_at(mechanism, found.q))
    return replace(
        closed,
        assumed=(*assumed, *_of_home(mechanism, stated, found), *missing),
        rounding=rounding,
        open_by=found.open,
    )


def refuse_open(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism, or raise ``DescriptionError`` where its home is open."""
    if mechanism.home_open:
        raise DescriptionError(
            f"the home posture of {mechanism.name!r} cannot be closed: {mechanism.assumed[0]}; "
            "give parameters that fit, or joint values nearer to closure in <group_state "
            'name="home">'
        )
    return mechanism


def _of_home(mechanism: Mechanism, stated: np.ndarray, found: Assembled) -> tuple[str, ...]:
    """Sentences on a home that is not where it is stated."""
    if found.open:
        why = found.message.removeprefix("does not close: ")
        return (f"no closed posture was found and home is open: {why}",)
    notes = []
    names = mechanism.description.home
    changes = moved(mechanism, stated, found.q)
    if names:
        for name in names:
            if changes[name] > MOVED:
                was, now = (_words(mechanism, q, name) for q in (stated, found.q))
                notes.append(
                    f"home: joint {name!r} is stated at {was} and closes at {now}, "
                    f"{changes[name]:.3g} away"
                )
    elif max(changes.values(), default=0.0) > MOVED:
        shown = [name for name in changes if changes[name] > MOVED]
        listed = ", ".join(f"{name} {_words(mechanism, found.q, name)}" for name in shown[:8])
        more = f" and {len(shown) - 8} more" if len(shown) > 8 else ""
        notes.append(
            "no home is stated and the loops are open with all joints at zero: home is a closed "
            f"posture near that, {listed}{more}"
        )
    if found.message:
        notes.append(f"home {found.message}")
    return tuple(notes)


def _words(mechanism: Mechanism, q: np.ndarray, name: str) -> str:
    joint = mechanism.model.joints[mechanism.model.getJointId(name)]
    return " ".join(f"{x:.6g}" for x in q[joint.idx_q : joint.idx_q + joint.nq] + 0.0)


def _given(
    description: Description, home: Mapping[str, JointValue]
) -> dict[str, tuple[float, ...]]:
    """Values by joint; inputs are named too."""
    driven = {spec.name: spec.joint for spec in description.inputs}
    types = {joint.name: joint.type for joint in description.joints if joint.type != "fixed"}
    found = {}
    for name, value in home.items():
        joint = name if name in types else driven.get(name)
        if joint is None:
            raise DescriptionError(f"home: {known_names(str(name), 'joint', [*types, *driven])}")
        count = 7 if types[joint] == "floating" else 1
        try:
            numbers = np.ravel(real_array(value, joint))
        except ClosureError:
            numbers = np.zeros(0)  # no numbers: what must be there is told below
        if numbers.shape != (count,) or not np.isfinite(numbers).all():
            raise DescriptionError(
                f"home of joint {joint!r} must be {count} finite number{'s' * (count > 1)}, got "
                f"{value!r}"
            )
        if count == 7:
            norm = float(np.linalg.norm(numbers[3:]))
            if abs(norm - 1.0) > MOVED:
                raise DescriptionError(
                    f"home of joint {joint!r} needs a unit quaternion, got length {norm:.6g}"
                )
            numbers[3:] /= norm
        found[joint] = tuple(numbers.tolist())
    return found
