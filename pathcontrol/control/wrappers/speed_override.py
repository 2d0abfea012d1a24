"""Hold, slow down, go back: the speed of any law along its path as an input."""

from __future__ import annotations

from typing import Annotated

from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.wrappers.override_rule import Override, OverrideRule
from pathcontrol.control.wrappers.stopping_rate import stopping_rate
from pathcontrol.control.wrappers.wrapper import LawWrapper


class SpeedOverride(LawWrapper):
    """A law that goes along its path at an input u(t) times its speed: hold, slow down, hurry, go back.

    The factor w in use follows u within ``acceleration``, |ẇ| ≤ a, and ẇ has no jumps: it changes with a time constant
    of 20 ms. Nothing else changes, and the arm is asked to leave its path nowhere: :class:`LawWrapper` says why the
    theorems hold for any w.

    u = 1 is the law itself. At 0 the plan rests, and is not moved by what pushes the arm. Below 0 it goes back; an open
    path is braked at its begin as it is at its end. :meth:`hold`, :meth:`resume`, :meth:`override` and :meth:`reverse`
    set u from outside while the law runs, as in a control loop.

    Args:
        law: any law that is to be overridden.
        override: u from −2 to 2: a number, one for each rollout (N,), a function of the time since the law took over,
            in seconds, that returns either, or steps [[t, u], …], (m, 2), with u = 1 before the first;
            one step is [[t, u]].
        acceleration: largest |ẇ| [1/s]. At 10 the plan comes from full speed to rest in a tenth of a second; the
            acceleration along the path is ẇ‖q_d'ϑ‖ [rad/s²], the torque for it M(q)q_d'ϑẇ [N m]. By default it is what
            the torque limits of the law's model leave beside the motion everywhere on the path, from 2 to 10; of a
            batch of tasks, on all of their paths.

    Raises:
        InputError: u is not from −2 to 2, also while the law runs, or an argument has the wrong shape.
    """

    def __init__(
        self,
        law: Controller,
        override: Annotated[Override, Form.ARRAY] = 1.0,
        acceleration: Annotated[float, Form.POSITIVE, Unit("1/s")] | None = None,
    ) -> None:
        check_controller("law", law)
        rate = stopping_rate(law.robot, law.task) if acceleration is None else acceleration
        super().__init__(law, OverrideRule(override, rate))
