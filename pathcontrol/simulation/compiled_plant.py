"""The plant in the compiled engine, a step at a time, for laws and disturbances that are evaluated in Python."""

from __future__ import annotations

from ctypes import addressof

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.engine.library import load_library
from pathcontrol.engine.run_settings import add_plant
from pathcontrol.engine.structs import Memory, Rows, Setup, address_of
from pathcontrol.simulation.arm.plant import Walls, has_strong_friction
from pathcontrol.simulation.compiled_disturbances import add_structs, disturbance_struct
from pathcontrol.simulation.loops import Arm as SimulatedArm


class CompiledPlant:
    """The plant by the engine, a step at a time, for laws and disturbances that are evaluated in Python.

    Args:
        robot: the arm, or one for each rollout, with its friction.
        step: h [s].

    Raises:
        EngineError: an arm or its friction is beyond the engine.
    """

    def __init__(self, robot: SimulatedArm, step: float) -> None:
        self.step, self._memory, self._setup = step, Memory(), Setup(joints=robot.n)
        self._begins: list[Array] = []
        add_plant(self._setup, robot, has_strong_friction(robot), self._memory)
        self._advance = load_library().pathcontrol_advance

    def advance(
        self, q: Array, qd: Array, tau: Array, held: NDArray[np.bool_] | None = None, walls: Walls | None = None
    ) -> tuple[Array, Array]:
        """Return (q, q̇) one step later under the constant torque ``tau``, with ``held`` joints and ``walls``.

        All arrays are (N, n); of walls, the same at all steps, each has the rollouts for which it is there, (N,).

        Raises:
            EngineError: there are too many walls.
        """
        if walls:
            self._set_walls(walls)
        q, qd = np.array(q, order="C"), np.array(qd, order="C")
        torque, still = np.ascontiguousarray(tau), None
        if held is not None and held.any():
            still = np.empty(q.shape)
            still[...] = held
        arrays = [None if array is None else address_of(array) for array in (q, qd, torque, still)]
        self._advance(addressof(self._setup), self.step, *arrays, 0, len(q))
        return q, qd

    def _set_walls(self, walls: Walls) -> None:
        """Set the walls of a step: they begin at time 0 for the rollouts for which they are there, and else never."""
        if not self._begins:
            self._begins = [np.empty(len(stands)) for _, stands in walls]
            structs = [disturbance_struct(wall, self._setup.joints, self._memory) for wall, _ in walls]
            for struct, begin in zip(structs, self._begins, strict=True):
                struct.start, struct.duration = Rows(address_of(begin), 1), self._memory.numbers(np.inf)
            add_structs(self._setup, structs, self._memory)
        for begin, (_, stands) in zip(self._begins, walls, strict=True):
            begin[...] = np.where(stands, 0.0, np.inf)
