"""The rules of wrapped laws as structs of the engine, and what their operators ask for."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import addressof
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.contact_rule import ContactRule
from pathcontrol.control.wrappers.event_plan import EventPlan
from pathcontrol.control.wrappers.override_rule import OverrideRule
from pathcontrol.control.wrappers.pace_rule import FastestPlan, PaceRule
from pathcontrol.control.wrappers.paced import Paced
from pathcontrol.control.wrappers.speed_override import SpeedOverride
from pathcontrol.control.wrappers.wrapper import LawWrapper, wrappers_of
from pathcontrol.engine.structs import MOST_RULES, Memory, Rule, Setup
from pathcontrol.errors import EngineError
from pathcontrol.tasks.task import PathTask

#: the kinds of rules, in the order of the engine's numbers, and the wrappers that do nothing else than to have one
RULES = (OverrideRule, ContactRule, PaceRule)
WRAPPERS = (LawWrapper, SpeedOverride, Paced, EventPlan)
_AHEAD, _AHEAD_OF_FUNCTIONS = 1 << 17, 1 << 9  # ticks
#: puts the tables of tasks into memory and returns the address of the first
TaskTables = Callable[[PathTask, Memory], int]


class SpeedRules:
    """The rules of a law for the speed along its path, as the engine runs them; none for a law that is not wrapped.

    Args:
        law: the law.
        tables: puts the tables of tasks into memory.

    Raises:
        EngineError: a wrapper or one of its rules is in Python, or there are too many.
    """

    def __init__(self, law: Controller, tables: TaskTables) -> None:
        self._rules = law.rules if isinstance(law, LawWrapper) else ()
        self._tables = tables
        for one in (*wrappers_of(law), *self._rules):
            if type(one) not in (*WRAPPERS, *RULES) or not _is_of(one, law):
                raise EngineError(f"{type(one).__name__} is in Python", value=type(one).__name__)
        if sum(isinstance(rule, PaceRule) for rule in self._rules) > 1:
            raise EngineError("a pace of a pace is in Python", value="PaceRule")
        if len(self._rules) > MOST_RULES:
            raise EngineError(
                f"there are {len(self._rules)} rules of speed, the engine takes {MOST_RULES} at most",
                value=len(self._rules),
                limit=MOST_RULES,
            )
        self._structs = (Rule * len(self._rules))()
        self._overrides = [rule for rule in self._rules if isinstance(rule, OverrideRule)]
        self._memory = Memory()

    def add_to(self, setup: Setup, joints: int) -> None:
        """Set the rules of a run; their states come after what the law remembers by then."""
        setup.rules, setup.inputs = len(self._rules), len(self._overrides)
        for rule, struct in zip(self._rules, self._structs, strict=True):
            struct.kind, struct.first = RULES.index(type(rule)), setup.memory
            setup.memory += rule.size
            if isinstance(rule, OverrideRule):
                struct.input, struct.acceleration = self._overrides.index(rule), rule.acceleration
            elif isinstance(rule, ContactRule):
                struct.threshold = self._memory.rows(rule.threshold, joints)
                struct.pause, struct.acceleration = rule.pause, rule.acceleration
            elif isinstance(rule, PaceRule):
                struct.torque = self._memory.address(rule.torque)
                struct.fastest = self._tables(rule.plan.fastest, self._memory)
        setup.rule = addressof(self._structs)

    @property
    def longest(self) -> int:
        """The most ticks to ask for at once: few where a user's function is asked, which may take its time."""
        return _AHEAD if all(rule.is_known for rule in self._overrides) else _AHEAD_OF_FUNCTIONS

    def ask(self, times: Array, rollouts: int) -> Array:
        """Return u of all overrides at ``times`` [s], (m, overrides, N), to the first time at which one is an error.

        Raises:
            InputError: an override is out of range at the first of the times.
            EngineError: a plan that goes back has a fastest profile that has no table.
        """
        given = [rule.values(times, rollouts) for rule in self._overrides]
        known = min((len(u) for u in given), default=len(times))
        asked = np.empty((known, len(given), rollouts))
        for k, u in enumerate(given):
            asked[:, k] = u[:known]
        if (asked < 0).any():
            self.prepare_to_go_back()
        return asked

    def prepare_to_go_back(self) -> None:
        """Set the fastest plans that go back, which take a while to compute.

        Raises:
            EngineError: one has no table.
        """
        for rule, struct in zip(self._rules, self._structs, strict=True):
            if isinstance(rule, PaceRule) and not struct.fastest_back:
                struct.fastest_back = self._tables(rule.plan.fastest_back, self._memory)


def _is_of(one: Any, law: Controller) -> bool:
    """Return whether a wrapper or rule is made of parts of the library, and for the arm and the task of the law."""
    if isinstance(one, PaceRule):
        return type(one.plan) is FastestPlan and one.plan.task is law.task
    if isinstance(one, ContactRule):
        return type(one.ramp) is OverrideRule and one.robot is law.robot
    return not callable(vars(one).get("law"))
