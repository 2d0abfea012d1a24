"""Units of annotations and docstrings agree, and the example shows every argument."""

from __future__ import annotations

import inspect
import re

import pytest

from pathcontrol._units import parse_quantity
from pathcontrol.arguments import Form, Unit, parameters_of
from pathcontrol.experiments.template import example_text
from pathcontrol.registry import KINDS, LOOPS, Kind

EVERY = [(kind, name) for kind in (*KINDS, LOOPS) for name in kind.members]


@pytest.mark.parametrize(("kind", "name"), EVERY, ids=[name for _, name in EVERY])
def test_units_of_docstrings_are_those_of_annotations(kind: Kind, name: str):
    """Where a docstring has ``[rad/s]`` of a parameter, its annotation has a unit of that dimension."""
    target = kind.find(name)
    for argument, parameter in parameters_of(target).items():
        said = None
        for one in getattr(target, "__mro__", (target,)):
            said = said or re.search(rf"(?m)^    {argument}: .*?\[([^]]*)\]", inspect.cleandoc(one.__doc__ or ""))
        units = {unit.replace("²", "^2").replace("³", "^3") for unit in re.split(" or ", said[1])} if said else set()
        units = {unit for unit in units if re.search(r"rad|[mNs]", unit) and not re.search(r"[,(]", unit)}
        mark = parameter.unit
        if units and mark is not None:
            for unit in units:
                parse_quantity(f"1 {unit}", *mark.names, *([mark.tool] if mark.tool else []))
        formulas = parameter.form in (Form.FORMULA, Form.FORMULAS)
        assert formulas or bool(units) <= (mark is not None), f"{name}.{argument} in {units} has no Unit"


def test_a_unit_is_of_a_quantity():
    assert Unit("N m", "N").names == ("N m", "N")
    for kind, name in EVERY:
        for parameter in parameters_of(kind.find(name)).values():
            for unit in () if parameter.unit is None else parameter.unit.names:
                assert parse_quantity(f"2 {unit}", unit) == 2.0


def test_the_example_shows_every_argument():
    text = example_text()
    for kind, name in EVERY:
        for argument, parameter in parameters_of(kind.find(name)).items():
            if parameter.required and argument not in kind.given:
                assert re.search(rf"\b{argument} = ", text), f"{name}.{argument}"
