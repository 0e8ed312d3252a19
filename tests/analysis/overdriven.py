"""Eclipse with its three revolute joints driven as well: nine inputs for six freedoms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import closedchain as cc
from closedchain.closure.loading import mechanism_from_description


@cache
def overdriven_eclipse() -> cc.Mechanism:
    description = cc.load("eclipse").description
    one = description.inputs[0]
    extra = (replace(one, name=f"r_{leg}", joint=f"{leg}_R") for leg in "abc")
    return mechanism_from_description(replace(description, inputs=(*description.inputs, *extra)))
