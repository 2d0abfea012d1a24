"""Units of annotations and docstrings agree, and the example shows every argument."""

from __future__ import annotations

import inspect
import re
from typing import Annotated

import numpy as np
import pytest
from pydantic import ValidationError

from pathcontrol import Space, load_robot, simulate, sweep, tune
from pathcontrol._units import parse_quantity
from pathcontrol.arguments import Form, Unit, parameters_of
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import run_experiment
from pathcontrol.experiments.schema.derived import section_of
from pathcontrol.experiments.schema.experiment import Experiment, Start
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


def several(one: str | int, other: float | bool | None = None, third: int | float = 0) -> None:
    """Arguments that may be of more than one type."""


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"one": "a"}, None),
        ({"one": 1, "other": 0.5, "third": 2}, None),
        ({"one": 1, "other": False, "third": 0.5}, None),
        ({"one": 1.5}, "one = 1.5, expected a text in quotes, or a whole number"),
        ({"one": True}, "one = true, expected a text in quotes, or a whole number"),
        ({"one": 1, "other": "x"}, "other = 'x', expected a finite number, or true or false"),
        ({"one": 1, "third": "x"}, "third = 'x', expected a whole number, or a finite number"),
    ],
)
def test_an_argument_of_several_types_takes_each_of_them(given, said):
    if said is None:
        assert section_of(several).model_validate(given).arguments(float) == given
        return
    with pytest.raises(ValidationError) as error:
        section_of(several).model_validate(given)
    [detail] = error.value.errors()
    assert detail["loc"][-1] + detail["msg"] == said


@pytest.mark.parametrize("joint", [-1, 0.5, True, [0]])
def test_what_names_no_joint_is_told(write_experiment, joint):
    with pytest.raises(
        ExperimentError, match=r"disturbance.joint = .*, expected the name of a joint, or its number from 0"
    ):
        load_experiment(write_experiment({"disturbance": {"type": "jammed_joint", "joint": joint}}))


@pytest.mark.parametrize("joint", [1, "joint_2"])
def test_a_joint_is_named_or_numbered(write_experiment, joint, tmp_path):
    jam = {"type": "jammed_joint", "joint": joint, "start": 0.01, "duration": 0.02}
    run = run_experiment(write_experiment({"disturbance": jam}), tmp_path, progress=False).run
    held = run.array("q")[0, (run.time > 0.011) & (run.time < 0.029)]
    assert np.ptp(held[:, 1]) == 0.0 < np.ptp(held[:, 0])


def arguments_of(function, but=""):
    return parameters_of(function).keys() - set(but.split())


def keys_of(name):
    """The keys that a table of an experiment file may have."""
    with pytest.raises(ValidationError) as error:
        Experiment.model_validate({name: {"no_such_key": 1}})
    message = next(one["msg"] for one in error.value.errors() if one["loc"] == (name, "no_such_key"))
    return set(message.partition("valid keys: ")[2].split(", "))


def test_tables_of_functions_have_their_arguments():
    """A file says some in other words, as [sweep] says its space by keys of the file; but none is forgotten."""
    of_the_call = "build space out chunk resume progress cluster security engine"
    assert keys_of("sweep") == arguments_of(sweep, of_the_call) | arguments_of(Space)
    assert keys_of("tune") == arguments_of(tune, of_the_call) | {"parameters"}
    assert keys_of("robot") == arguments_of(load_robot, "threads") | {"payload", "tool"}
    assert Start.model_fields.keys() | Experiment.model_fields.keys() >= arguments_of(
        simulate, "first_rollout progress"
    )


def test_an_argument_more_of_a_function_is_a_key_more(monkeypatch):
    def load(source: str, *, mirrored: bool = False, threads: int = 1) -> None:
        """Load an arm, mirrored if asked."""

    monkeypatch.setattr("pathcontrol.robot.loading.load_robot", load)
    assert keys_of("robot") == {"source", "friction", "lock", "estimated_inertia", "payload", "tool", "mirrored"}
    with pytest.raises(ValidationError) as error:
        Experiment.model_validate({"robot": {"source": "two_link", "mirrored": 1}})
    assert any(one["msg"] == " = 1, expected true or false" for one in error.value.errors())


def partly_understood(speed: Annotated[float, Form.POSITIVE, Unit("m/s")], other: NowhereDefined) -> None:  # noqa: F821
    """Arguments of which one has a type that only a type checker knows."""


def test_an_annotation_that_cannot_be_understood_leaves_the_others_alone():
    section = section_of(partly_understood)
    assert section.model_validate({"speed": "50 mm/s", "other": "x"}).arguments(float) == {"speed": 0.05, "other": "x"}
    with pytest.raises(ValidationError, match="greater than 0"):
        section.model_validate({"speed": -1, "other": 1})
