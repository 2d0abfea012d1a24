"""Warnings of steps that are too long, found in every chunk of a sweep and given once of each kind."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from pathcontrol.errors import warn
from pathcontrol.simulation.checks.too_long import StepWarning, find_steps_too_long
from pathcontrol.simulation.run_arguments import broadcast_states, check_loop, make_plant, start_law

_ROLLOUT = re.compile(r" \(rollout (\d+)\)")
_NUMBER = re.compile(r"[0-9][0-9.e+-]*")


def find_step_warnings(arguments: Mapping[str, Any], samples: NDArray[Any]) -> Iterator[str]:
    """Yield the warnings of steps for a simulation of ``samples`` (k,), with sample numbers in place of rollouts."""
    controller, disturbance = arguments["controller"], arguments.get("disturbance")
    robot, loop = make_plant(arguments.get("plant"), controller), check_loop(arguments.get("loop"))
    states = broadcast_states(arguments["q"], arguments.get("qd"), robot, controller.task)
    q, qd, _ = start_law(controller, *states, disturbance)
    for sentence in find_steps_too_long([controller], loop, robot, q, qd, disturbance, arguments["duration"]):
        found = _ROLLOUT.search(sentence)
        number = samples[int(found[1]) if found else 0]
        yield f"sample {number}: {_ROLLOUT.sub('', sentence)}"


class WarningFilter:
    """A filter that warns of each kind of sentence once; sentences of a kind differ in their numbers alone."""

    def __init__(self) -> None:
        self._kinds: set[str] = set()

    def __call__(self, sentences: Sequence[str]) -> None:
        """Warn of sentences of a new kind."""
        for sentence in sentences:
            if (kind := _NUMBER.sub("#", sentence)) not in self._kinds:
                self._kinds.add(kind)
                warn(f"{sentence}; other samples may be alike", StepWarning)
