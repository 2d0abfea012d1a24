"""The table of ``[controller]`` in the documentation lists the laws of the library, with their arguments."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pathcontrol.arguments import parameters_of
from pathcontrol.registry import LAWS

PAGE = (Path(__file__).parents[2] / "docs" / "experiments.md").read_text(encoding="utf-8")
SECTION = PAGE.partition("**`[controller]`**")[2].partition("**`[plant]`**")[0]
OF_ALL = {"robot", "task", "friction", "start", "observer_hz"}


@pytest.mark.parametrize("name", LAWS.members)
def test_each_law_is_listed_with_its_arguments(name):
    row = next((line for line in SECTION.splitlines() if line.startswith(f'| `"{name}"` |')), "")
    missing = parameters_of(LAWS.find(name)).keys() - OF_ALL - set(re.findall(r"`(\w+)`", row))
    assert row, f"the table has no row of {name}"
    assert not missing
