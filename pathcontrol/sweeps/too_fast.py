"""What is too fast for the period or the steps is looked for in every chunk of a sweep, and told once of each kind."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from pathcontrol.simulation.arguments import broadcast_states, check_loop, make_plant, start_law
from pathcontrol.simulation.checks.too_long import StepWarning, find_steps_too_long

_ROLLOUT = re.compile(r" \(rollout (\d+)\)")
_NUMBER = re.compile(r"[0-9][0-9.e+-]*")


def too_fast(arguments: Mapping[str, Any], samples: NDArray[Any]) -> Iterator[str]:
    """Say what a simulation of ``samples`` (k,) would warn of, with the number of a sample and not of a rollout."""
    controller, disturbance = arguments["controller"], arguments.get("disturbance")
    robot, loop = make_plant(arguments.get("plant"), controller), check_loop(arguments.get("loop"))
    states = broadcast_states(arguments["q"], arguments.get("qd"), robot, controller.task)
    q, qd, _ = start_law(controller, *states, disturbance)
    for sentence in find_steps_too_long([controller], loop, robot, q, qd, disturbance, arguments["duration"]):
        found = _ROLLOUT.search(sentence)
        number = samples[int(found[1]) if found else 0]
        yield f"sample {number}: {_ROLLOUT.sub('', sentence)}"


class Teller:
    """Warns of each kind of sentence once: of those that differ in their numbers alone, of the first."""

    def __init__(self) -> None:
        self._kinds: set[str] = set()

    def __call__(self, sentences: Sequence[str]) -> None:
        """Warn of those whose kind is new."""
        for sentence in sentences:
            if (kind := _NUMBER.sub("#", sentence)) not in self._kinds:
                self._kinds.add(kind)
                warnings.warn(f"{sentence}; other samples may be alike", StepWarning, stacklevel=3)
