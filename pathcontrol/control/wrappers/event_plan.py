"""Event-based control: a plan that sensing halts at an obstacle and lets go on."""

from __future__ import annotations

from typing import Annotated, Any, Self

from numpy.typing import ArrayLike

from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.gains import diagonal_gain
from pathcontrol.control.observer import CUTOFF
from pathcontrol.control.wrappers.contact_rule import ContactRule
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap


class EventPlan(LawWrapper):
    """A law whose plan halts where the arm meets something, and goes on when that is gone.

    In event-based control (T. J. Tarn, N. Xi and A. Bejczy) what drives the motion reference is sensing and not time.
    Here a momentum observer senses: where it sees more torque at a joint than friction and ``threshold`` explain, the
    factor w of the speed goes to 0 within ``acceleration``, and back to 1 when the contact has been gone for
    ``pause``. Around :class:`Projection` the motion reference is estimated from the posture, as in that work the arc
    length is; around :class:`ExtendedMotionPlan` it is the plan, drawn to the arm by k ≥ 0.

    The condition on the motion reference is that of :class:`LawWrapper`: for every law with the torque of (25) or (39)
    and one k_p for all joints

        V̇ = −e_vᵀK_v e_v + k_p e_pᵀq_d'(σ̇ − wϑ),   V = ½e_vᵀe_v + ½k_p e_pᵀe_p,

    so σ̇ may be anything where e_p ⊥ q_d', as in projection, or wϑ − k e_pᵀq_d' with k(σ) ≥ 0. Neither asks for a sign
    or a size of w. The theorem is for an arm without contact: in contact V may grow, from where the arm is let go it
    falls.

    A law that no longer pushes, as projection at rest, sees nothing of what is still there: after the pause it tries
    again, and is halted again.

    Args:
        law: any law of the library, one that calls :meth:`Controller.compensate`, or a wrapper around one.
        threshold: the torque beyond friction at which the plan is halted [N m], a number, (n,), or (N, n) with a row
            for each rollout. By default a tenth of the effort limits. It has to be more than what the model does not
            know of loads and friction.
        acceleration: largest |ẇ| [1/s], 10 by default: from full speed to rest in a tenth of a second.
        pause: how long the contact has to be gone [s].
        observer_hz: corner frequency of the observer [Hz], unless the law has one, ``friction="observed"``.

    Raises:
        InputError: an argument is not greater than 0, or the robot has no effort limits and no threshold is given.
    """

    def __init__(
        self,
        law: Controller,
        threshold: Annotated[ArrayLike, Form.GAIN, Unit("N m", "N")] | None = None,
        acceleration: Annotated[float, Form.POSITIVE, Unit("1/s")] = 10.0,
        pause: Annotated[float, Form.POSITIVE, Unit("s")] = 0.2,
        observer_hz: Annotated[ArrayLike, Form.GAIN, Unit("Hz")] = CUTOFF,
    ) -> None:
        check_controller("law", law)
        super().__init__(law, ContactRule(unwrap(law).robot, threshold, acceleration, pause))
        self._observer_hz = diagonal_gain("observer_hz", observer_hz, self.robot.n, self.robot.joint_names)
        self._watch()

    def around(self, law: Controller) -> Self:
        wrapper = super().around(law)
        wrapper._watch()
        return wrapper

    def arguments(self) -> dict[str, Any]:
        return self.settings() | {"observer_hz": self._observer_hz.tolist()}

    def _watch(self) -> None:
        """Let the law inside have an observer."""
        self.inner = self.inner.watching(self._observer_hz)
        self.observer = self.inner.observer
