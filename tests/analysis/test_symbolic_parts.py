"""Exact numbers, the ring of cosines and sines, and sizes as laws in the parameters."""

from __future__ import annotations

from fractions import Fraction
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

import closedchain as cc
from closedchain.analysis.symbolic.exact import exact
from closedchain.analysis.symbolic.factors import factored, primitive
from closedchain.analysis.symbolic.parameters import number, sizes
from closedchain.analysis.symbolic.ring import Angle, Ring, evaluate
from closedchain.analysis.symbolic.spaces import pairing, reciprocal

A, B = Angle({"a": Fraction(1)}), Angle({"b": Fraction(1)})
SUM = A + B


def test_exact_numbers() -> None:
    assert exact(0.2) == {(): Fraction(1, 5)}
    assert exact(-sqrt(3) / 2) == {(3,): Fraction(-1, 2)}
    assert exact(sqrt(6) / 4) == {(2, 3): Fraction(1, 4)}
    assert exact(0.0) == {}
    assert exact(0.12345) == {(): Fraction("0.12345")}
    assert exact(pi) is None


@pytest.mark.parametrize("k", range(-24, 25))
def test_constant_angles_are_exact(k: int) -> None:
    ring = Ring([], [A])
    c, s = ring.cos_sin(A + Angle({"pi": Fraction(k, 12)}))
    for value in (0.3, -1.7):
        assert evaluate(ring, c, {"a": value}) == pytest.approx(cos(value + k * pi / 12), abs=1e-14)
        assert evaluate(ring, s, {"a": value}) == pytest.approx(sin(value + k * pi / 12), abs=1e-14)


def test_normal_form_decides_equality() -> None:
    ring = Ring(["r"], [A, B])
    (ca, sa), (cb, sb) = ring.cos_sin(A), ring.cos_sin(B)
    assert not ring.reduce(sa * sa + ca * ca - 1)
    r = ring.rotation([ring.one, ring.zero, ring.zero], A)
    back = [list(column) for column in zip(*r, strict=True)]
    assert ring.product(r, back) == ring.identity()
    assert ring.det(r) == ring.one
    matrix = [[ca, sa, cb], [sb, ca, sa], [cb, sb, ca]]
    at = {"a": 0.4, "b": -1.1, "r": 0.2}
    numbers = np.array([[evaluate(ring, x, at) for x in row] for row in matrix])
    assert evaluate(ring, ring.det(matrix), at) == pytest.approx(np.linalg.det(numbers), abs=1e-14)


def test_factors_in_the_form_that_shows_them() -> None:
    """1 - c^2 is s s, which no factoring of the polynomial tells."""
    ring = Ring(["r"], [A])
    c, s = ring.cos_sin(A)
    r = ring.values["r"]
    number_, parts = factored(ring, ring.mul(r - r * c * c, c))
    assert dict(parts) == {r: 1, s: 2, c: 1}
    assert number_ == 1
    content, rest = primitive(ring, [ring.reduce(s * s * r), ring.reduce(s * c * r)])
    assert ring.mul(content, rest[0]) == ring.reduce(s * s * r)
    assert rest in ([s, c], [-s, -c])


def test_reciprocal_screws() -> None:
    """Wrenches reciprocal to two hinges and a slide: three, and no work on any of them."""
    ring = Ring(["r"], [A])
    c, s = ring.cos_sin(A)
    r, one, zero = ring.values["r"], ring.one, ring.zero
    twists = [
        [zero, zero, one, zero, zero, zero],
        [zero, zero, one, ring.mul(r, s), -ring.mul(r, c), zero],
        [zero, zero, zero, c, s, zero],
    ]
    found = reciprocal(ring, twists, {"a": 0.7, "r": 0.2}, 0.1)
    assert len(found) == 3
    assert not any(pairing(ring, w, t) for w in found for t in twists)


PARAMETERS = """
<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="p" default="0.3"/>
  <xacro:arg name="at" default="0.1 0.2 0.3"/>
  <xacro:arg name="n" default="2"/>
  <xacro:arg name="unused" default="5"/>
  <link name="base"/><link name="one"/><link name="two"/>
  <joint name="A" type="revolute"><parent link="base"/><child link="one"/>
    <origin xyz="${$(arg p)*sqrt(3)/2 + 0.1} $(arg at)"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="B" type="revolute"><parent link="one"/><child link="two"/>
    <origin xyz="${$(arg p)**2} 0 0" rpy="0 0 ${pi/$(arg n)}"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>
""".replace('+ 0.1} $(arg at)"', "+ 0.1} ${[float(v) for v in '$(arg at)'.split()][1]} 0\"")


def test_sizes_as_laws() -> None:
    m = cc.load_urdf(PARAMETERS)
    found = sizes(m.description)
    law = found.laws["joint A", "xyz", 0]
    assert law.constant == {(): Fraction(1, 10)}
    assert law.slopes == {"p": {(3,): Fraction(1, 2)}}
    assert found.laws["joint A", "xyz", 1].slopes == {"at_y": {(): Fraction(1)}}
    square = found.laws["joint B", "xyz", 0]
    assert not square.slopes
    assert number(square.constant) == pytest.approx(0.09)
    assert any("xyz of joint B is no affine function of p" in note for note in found.notes)
    assert "unused" not in found.values
    assert found.values["p"] == 0.3


def test_sizes_without_xacro_are_numbers() -> None:
    m = cc.load_urdf(cc.load_urdf(PARAMETERS).description.text)
    found = sizes(m.description)
    assert m.description.source is None
    assert not found.values
    assert not any(law.slopes for law in found.laws.values())


def test_source_is_kept_for_other_parameters() -> None:
    from closedchain.urdf import load_description

    d = cc.load("eclipse", r=0.15).description
    assert d.source is not None
    again = load_description(d.source, dict(d.parameters))
    assert again == d
