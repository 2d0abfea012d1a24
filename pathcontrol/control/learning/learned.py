"""A law that learns, lap by lap of a closed path, the torque that its model does not know."""

from __future__ import annotations

from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_whole
from pathcontrol.arguments import Form
from pathcontrol.control.base import Controller
from pathcontrol.control.learning.learned_table import LapMemory, LearnedTable
from pathcontrol.control.learning.learning_law import LearningLaw
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.errors import InputError, TaskError

_FEWEST = 8  # nodes of a lap


class Learned(LawWrapper):
    """A law with a feedforward torque τ̂(s) that it learns lap by lap, at places of its path and not at times.

    From tick to tick the momentum p = M(q)q̇ says which torque d acted beside the motors (:class:`MomentumObserver`,
    without its low passes); what model and law lack is u = −d − f̂(q̇), with the friction f̂ that the law compensates.
    At the end of a lap each node of a table takes the mean ū of what was seen around it:

        τ = (law inside) + τ̂(s),   τ̂ ← (1 − γ) τ̂ + γ ū,   γ = ``learning_gain``,   γ = 1 at the first time

    The table is a mean of measured torques and not a sum of errors, so that it is bounded by them, for any gains of the
    law inside. Where u does not depend on τ̂ its error shrinks by 1 − γ in a lap. Where it does, by the linear map Δ of
    a model with wrong inertia, Δ = (1 − M̂M⁻¹)S with the sensitivity S of the law inside to a torque, the lap is a
    contraction if ‖1 − γ + γΔ‖ < 1, for which ‖Δ‖ < 1 suffices. What motors at their limits cannot give is no
    disturbance, so nothing winds up.

    A lap is learned from where the factor w of the speed is within 0.1 of 1: what is held, slowed down or paced keeps
    what is known. So does a joint that rests, where friction takes whatever is given, and the first lap, in which the
    arm comes to its path. A plan that goes back has none of τ̂, as friction turns round with it.

    Where a table that fitted leaves more than ``misfit`` of u in a lap, in the root mean square at a joint, the arm is
    not what it was: the table is forgotten, which is that the next lap replaces all of it, with γ = 1. The outcomes
    ``forgotten`` and ``forgotten_time`` of a run say so, and its remarks in reports and on the command line.

    (Learning from lap to lap: S. Arimoto, S. Kawamura and F. Miyazaki, J. Robotic Systems 1, 1984; surveyed by
    D. A. Bristow, M. Tharayil and A. G. Alleyne, IEEE Control Systems Magazine 26, 2006. The sensed torque: A. De Luca
    and R. Mattone, ICRA 2005.)

    Args:
        law: any law on a closed path that calls :meth:`Controller.compensate`, or a wrapper around one.
        learning_gain: γ, 0 < γ ≤ 1.
        nodes: number of nodes of the table, at most one for each tick of a lap.
        misfit: share of u that a table may leave before it is forgotten, > 0.

    Raises:
        InputError: an argument is out of its range, or the law learns already.
        TaskError: the path is not closed.
    """

    inner: LearningLaw

    def __init__(
        self,
        law: Controller,
        learning_gain: Annotated[float, Form.POSITIVE] = 0.5,
        nodes: int = 256,
        misfit: Annotated[float, Form.POSITIVE] = 0.4,
    ) -> None:
        super().__init__(law)
        gain = as_scalar("learning_gain", learning_gain, positive=True)
        if gain > 1:
            raise InputError(
                f"learning_gain = {gain:g}, expected a gain γ of 0 < γ ≤ 1",
                argument="learning_gain",
                value=gain,
                limit=(0.0, 1.0),
            )
        if not self.task.closed:
            raise TaskError(
                f"{type(self.task).__name__} is not closed, so that nothing is learned from lap to lap",
                argument="law",
                value=law,
            )
        if isinstance(self.inner, LearningLaw):
            raise InputError("the law is Learned already; wrap it once", argument="law", value=law)
        self._settings: dict[str, Any] = {
            "learning_gain": gain,
            "nodes": check_whole("nodes", nodes, _FEWEST),
            "misfit": as_scalar("misfit", misfit, positive=True),
        }
        self._learn()

    def around(self, law: Controller) -> Self:
        wrapper = super().around(law)
        wrapper._learn()
        return wrapper

    def _learn(self) -> None:
        """Let the law inside have a table."""
        said = self._settings
        table = LearnedTable(said["nodes"], self.robot.n, said["learning_gain"], said["misfit"])
        self.inner = LearningLaw(self.inner, table)
        self.observer = self.inner.observer

    def recall(self, z: ArrayLike) -> LapMemory:
        """Return the table in a state z of this law, (*batch, m), as :attr:`ControlTick.state` gives it.

        Raises:
            InputError: z is shorter than a state of this law.
        """
        state = as_array("z", z)
        own = self.split(state)[0] if state.ndim else state
        if not own.ndim or own.shape[-1] <= self.inner.table.size:
            raise InputError(
                f"z has shape {state.shape}, expected a state of this law, (*batch, m), as ControlTick.state gives it, "
                "or pc.law_states(run, law)",
                argument="z",
                value=state,
            )
        return self.inner.table.split(self.inner.split(own)[1])

    @property
    def nodes(self) -> Array:
        """The path parameters of the nodes of the table, (nodes,)."""
        count = self._settings["nodes"]
        return np.asarray(self.task.s0 + np.arange(count) * self.task.period / count)

    def settings(self) -> dict[str, Any]:
        return self._settings
