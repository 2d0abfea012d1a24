"""The interface of a task: a desired path and a desired velocity profile."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, TaskError, warn_of_single
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.geometry.differentiation import Differentiator, find_width
from pathcontrol.tasks.profile import plain_attributes

_MOST_SHOWN = 16  # most values of an array that a repr shows


class PathPoint(NamedTuple):
    """The values of a task at path parameter s, all that a controller needs of it."""

    q_d: Array
    dq_d: Array
    ddq_d: Array
    theta: Array
    dtheta: Array

    @property
    def velocity(self) -> Array:
        """Desired joint velocity r = q_d'ϑ, (*batch, n)."""
        return self.dq_d * self.theta[..., None]

    @property
    def velocity_slope(self) -> Array:
        """Slope r' = dr/ds = q_d''ϑ + q_d'ϑ', (*batch, n); the desired acceleration is r'ṡ."""
        return self.ddq_d * self.theta[..., None] + self.dq_d * self.dtheta[..., None]

    def at_speed(self, factor: Array) -> PathPoint:
        """Return the point with ϑ and ϑ' times a ``factor`` (*batch,)."""
        return self._replace(theta=self.theta * factor, dtheta=self.dtheta * factor)


class Task(ABC):
    """The interface of tasks that control laws and simulations use; users subclass :class:`PathTask`.

    Attributes:
        s0: first path parameter.
        s_end: last path parameter; ``inf`` for a path that does not end.
        period: for a closed path, the period of q_d and ϑ in s; else ``None``.
        frame: name of the frame of the arm that the path was made for, such as its tool; ``None`` where none is said.
            What is made from the path keeps it, and films, figures and metrics show it.
        tool_pose: pose in that frame of what follows the path, (4, 4); ``None`` for the frame itself.
        rotations: how many rotations of that the path prescribes: 3, 2 where it may turn about its z axis, or 0.
        rollouts: for how many rollouts it has a task each; ``None`` for one task that is that of any.
        kept_by_arguments: whether a saved run keeps it by the arguments of its constructor, which are attributes of the
            same names; others are kept by samples.
        kept_as: the class of the library that a saved run keeps it as, by its name; empty for its own.
    """

    s0: float = 0.0
    s_end: float = np.inf
    period: float | None = None
    frame: str | None = None
    tool_pose: Array | None = None
    rotations: int = 0
    rollouts: int | None = None
    kept_by_arguments: ClassVar[bool] = False
    kept_as: ClassVar[str] = ""

    def __init_subclass__(cls, single: bool | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        if single is not None:
            warn_of_single(cls.__name__)

    @abstractmethod
    def q_d(self, s: Array) -> Array:
        """Return the desired path [rad], (*batch, n), at s (*batch,); it is twice continuously differentiable."""

    @abstractmethod
    def theta(self, s: Array) -> Array:
        """Return the desired velocity profile ϑ(s) > 0 [1/s], (*batch,): the rate of the path parameter."""

    def dq_d(self, s: Array) -> Array:
        """Return the first derivative q_d'(s) = dq_d/ds [rad], (*batch, n)."""
        return self._path_derivative(s, 1)

    def ddq_d(self, s: Array) -> Array:
        """Return the second derivative q_d''(s) = d²q_d/ds² [rad], (*batch, n)."""
        return self._path_derivative(s, 2)

    def dtheta(self, s: Array) -> Array:
        """Return the derivative of the profile, ϑ'(s) = dϑ/ds [1/s], (*batch,)."""
        return self._profile_derivative(s, 1)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Return the projection σ̄(q) [-], (*batch,): the parameter of the point of the path nearest to q (*batch, n).

        It solves (q_d(σ̄) − q)ᵀ q_d'(σ̄) = 0, eq. (29). Without ``near`` it is the global minimum, in [s0, s0 + period)
        for closed paths. With ``near`` (*batch,), the parameter of a moment ago, it is the local minimum downhill from
        there, so that the branch is followed by continuity, and laps are counted. Only where ``near`` cannot be of a
        moment ago, since q − q_d(near) is far from normal to the path, and no minimum is close by, it is global.

        Override it where there is a closed form. When to leave a branch for a nearer one is up to the controller:
        see :class:`BranchPolicy`.
        """
        return self._closest_point(q, near)

    def at(self, s: Array) -> PathPoint:
        """Return q_d, q_d', q_d'', ϑ and ϑ' at s (*batch,). Override where they share work."""
        zero = np.zeros_like(s, dtype=np.float64)  # ϑ may be a plain number
        return PathPoint(self.q_d(s), self.dq_d(s), self.ddq_d(s), self.theta(s) + zero, self.dtheta(s) + zero)

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(np.asarray(self.q_d(np.asarray(self.s0, dtype=np.float64))).shape[-1])

    @property
    def by_hand(self) -> bool:
        """True if q_d is written outside this library, so that nothing is known of its smoothness."""
        return not type(self).__module__.startswith("pathcontrol.")

    @property
    def closed(self) -> bool:
        """True if the path closes on itself."""
        return self.period is not None

    @property
    def one_traverse(self) -> tuple[float, float]:
        """The parameters [rad or -] of the begin and the end of one pass over the whole path.

        Raises:
            TaskError: the path goes on for ever without repeating.
        """
        end = self.s_end if self.period is None else self.s0 + self.period
        if not np.isfinite(end):
            raise TaskError(
                f"{type(self).__name__} neither ends nor repeats, so its nearest point cannot be searched; give it a "
                "finite s_end or a period, or override sigma_bar"
            )
        return self.s0, end

    @property
    def knots(self) -> Array | None:
        """The parameters where the pieces of the path meet, increasing, (K,); ``None`` for a path of one piece.

        The projection cuts the path there first, and so misses no piece of a long one.
        """
        return None

    @property
    def profile_knots(self) -> Array | None:
        """The parameters where ϑ' may jump, increasing, (J,); ``None`` for a smooth profile.

        The distance to Γ is searched between them, as Γ has a corner there.
        """
        return None

    @property
    def polyline(self) -> Array | None:
        """The points of the polyline that the path stands for, whose corners :func:`accuracy` measures, (k, d).

        They are in the base frame [m] where the path is made for a frame, and else in the space of joints [rad]; a
        closed polyline does not repeat its first point. ``None`` for a path that stands for none.
        """
        return None

    @property
    def sampled_interval(self) -> tuple[float, float]:
        """A finite part of the domain that represents the whole."""
        end = self.s_end if self.period is None else self.s0 + self.period
        return self.s0, end if np.isfinite(end) else self.s0 + 2 * np.pi

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={_shorten(v)}' for k, v in plain_attributes(self).items())})"

    def describe(self) -> dict[str, Any]:
        """Return the name and the public parameters, for the record of a run."""
        return {"task": type(self).__name__} | plain_attributes(self)

    def keep_tool(self, *paths: Task) -> None:
        """Take over the frame of ``paths``, and the tool pose in it, if these are the same for all."""
        frame, pose = paths[0].frame, paths[0].tool_pose
        if isinstance(frame, str) and all(
            path.frame == frame and _is_same_pose(path.tool_pose, pose) for path in paths
        ):
            self.frame, self.tool_pose = frame, pose
            self.rotations = min(path.rotations for path in paths)

    # --- inside ---------------------------------------------------------------------------------------------

    def _differentiator(self, function: Any) -> Differentiator:
        lower, upper = self.sampled_interval
        width = find_width(function, lower, upper)
        return Differentiator(function, self.s0 if self.period is None else -np.inf, self.s_end, width)

    @cached_property
    def _path_derivative(self) -> Differentiator:
        return self._differentiator(self.q_d)

    @cached_property
    def _profile_derivative(self) -> Differentiator:
        return self._differentiator(self._broadcast_theta)

    def _broadcast_theta(self, s: Array) -> Array:
        return self.theta(s) + np.zeros_like(s)

    @cached_property
    def _closest_point(self) -> ClosestPoint:
        lower, upper = self.one_traverse
        return ClosestPoint(Curve(self.q_d, self.dq_d, self.ddq_d), lower, upper, self.closed, self.knots)


def refuse_batch(name: str, task: Task, argument: str | None = None) -> None:
    """Check that ``task`` is a single task and not a batch; errors call it ``name``.

    Raises:
        InputError: ``task``, which is called so, is a batch.
    """
    if task.rollouts is not None:
        raise InputError(
            f"{name} is a TaskBatch of {task.rollouts} tasks, expected one task; take them one by one",
            argument=argument or name,
            value=task,
        )


def _is_same_pose(a: Array | None, b: Array | None) -> bool:
    """Return whether two poses are the same, or both missing."""
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def _shorten(value: Any) -> str:
    """Write a number, a text or a small array in full, and of a large array its shape."""
    shape = np.shape(value)
    return f"<{' × '.join(map(str, shape))} values>" if np.size(value) > _MOST_SHOWN else str(value)
