"""The dynamics and kinematics of an arm.

Arrays have leading batch axes: q, q̇, τ are ``(*batch, n)`` in the order of ``joint_names``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array
from pathcontrol._expect import did_you_mean
from pathcontrol.errors import InputError, UnknownNameError, UrdfError
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.bodies import idle_joints
from pathcontrol.robot.friction import FrictionLaw
from pathcontrol.robot.rigid_body import RigidBody, broadcast

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED  # the frame's origin, axes parallel to the base's


@dataclass(frozen=True)
class UrdfSource:
    """The origin of a model: the URDF's text, the folders its mesh files are looked up in, and its known name."""

    text: str
    base_dir: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    name: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class ArmDynamics:
    """The rigid-body model M(q)q̈ + C(q,q̇)q̇ + g(q) = τ of a fixed-base arm, as :class:`RobotModel` has it.

    Friction is kept beside the rigid-body terms and enters none of them.
    """

    pinocchio_model: Any
    actuation: Actuation
    source: UrdfSource
    threads: int = 1
    steps: tuple[tuple[str, dict[str, Any]], ...] = ()
    n: int = field(init=False)

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise InputError(
                f"threads = {self.threads}, expected 1 or more", argument="threads", value=self.threads, limit=1
            )
        object.__setattr__(self, "n", self.pinocchio_model.nv)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name}; {self.n} joints: {', '.join(self.joint_names)})"

    # --- what it is -----------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The robot's name in its URDF."""
        return self.pinocchio_model.name

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of every ``(*batch, n)`` array."""
        return tuple(self.pinocchio_model.names)[1:]

    @cached_property
    def position_units(self) -> tuple[str, ...]:
        """The unit of each joint's position: ``"rad"`` for those that turn, ``"m"`` for those that slide."""
        joints = list(self.pinocchio_model.joints)[1:]
        return tuple("m" if joint.shortname().startswith("JointModelP") else "rad" for joint in joints)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames: links, fixed and moving joints."""
        return tuple(frame.name for frame in self.pinocchio_model.frames)

    @property
    def limits(self) -> Limits:
        """Position, velocity and effort limits of the joints."""
        return self.actuation.limits

    @property
    def friction(self) -> FrictionLaw:
        """The friction law of the joints."""
        return self.actuation.friction

    def limit(self, joint: str) -> dict[str, float]:
        """Return the limits of one joint by its name: lower, upper [rad], velocity [rad/s], effort [N m]."""
        i = self.joint_index(joint)
        return {key: float(getattr(self.limits, key)[i]) for key in ("lower", "upper", "velocity", "effort")}

    @property
    def armature(self) -> Array:
        """Rotor inertia [kg m²] on the diagonal of M, (n,)."""
        return np.array(self.pinocchio_model.armature)

    @cached_property
    def has_mass(self) -> bool:
        """True if the joints move any mass; an arm without mass has kinematics and no dynamics."""
        bodies = list(self.pinocchio_model.inertias)[1:]
        return any(body.mass or body.inertia.any() for body in bodies) or bool((self.armature > 0).all())

    def joint_index(self, joint: str) -> int:
        """Return the index of a joint in ``joint_names``."""
        if joint not in self.joint_names:
            raise UnknownNameError(
                f"{self.name} has no movable joint {joint!r}; it has {', '.join(self.joint_names)}"
                f"{did_you_mean(joint, self.joint_names)}",
                joint=joint,
                value=joint,
                choices=self.joint_names,
            )
        return self.joint_names.index(joint)

    def frame_id(self, frame: str) -> int:
        """Return the index of a frame in Pinocchio's model; of a link and a joint of one name, that of the link."""
        # getFrameId answers nframes for a frame that does not exist, so ask first
        model = self.pinocchio_model
        if not isinstance(frame, str) or not model.existFrame(frame):
            raise UnknownNameError(
                f"{self.name} has no frame {frame!r}; it has {', '.join(self.frame_names)}"
                f"{did_you_mean(frame, self.frame_names)}",
                value=frame,
                choices=self.frame_names,
            )
        if model.existFrame(frame, pin.FrameType.BODY):  # a link and a joint may share a name
            return model.getFrameId(frame, pin.FrameType.BODY)
        return model.getFrameId(frame)

    # --- dynamics -------------------------------------------------------------------------------------------

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, velocity: ArrayLike | None = None) -> Array:
        """Return the torque τ = M(q)q̈ + C(q,q̇)q̇ + g(q) [N m], (*batch, n) (recursive Newton–Euler algorithm).

        With ``velocity`` v the Coriolis term is C(q,q̇)v, as passivity-based laws want it; see :meth:`coriolis`.
        """
        if velocity is None:
            return self._body.inverse_dynamics(q, qd, qdd)
        qd, v = self._array("qd", qd), self._array("velocity", velocity)
        surplus = self._centripetal(q, 0.5 * (qd - v))
        return self._body.inverse_dynamics(q, 0.5 * (qd + v), qdd) - surplus

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> Array:
        """Return q̈ = M(q)⁻¹(τ − C(q,q̇)q̇ − g(q)) [rad/s²], (*batch, n) (articulated-body algorithm)."""
        return self._body.forward_dynamics(q, qd, tau)

    def nonlinear_effects(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return C(q,q̇)q̇ + g(q) [N m], (*batch, n)."""
        return self.inverse_dynamics(q, qd, np.zeros(self.n))

    def gravity(self, q: ArrayLike) -> Array:
        """Return the gravity torque g(q) [N m], (*batch, n)."""
        q = self._array("q", q)
        zero = np.zeros(q.shape)
        return self.inverse_dynamics(q, zero, zero)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the mass matrix M(q) [kg m²], (*batch, n, n), by the composite rigid body algorithm."""
        return self._body.mass_matrix(q)

    def coriolis(self, q: ArrayLike, qd: ArrayLike, v: ArrayLike) -> Array:
        """Return C(q,q̇)v [N m], (*batch, n), with the C of Christoffel symbols: Ṁ − 2C is skew-symmetric.

        That C is symmetric in its two velocities, C(q,x)y = C(q,y)x, so with c(q,x) = C(q,x)x polarisation gives
        C(q,q̇)v = c(q,(q̇+v)/2) − c(q,(q̇−v)/2).
        """
        qd, v = self._array("qd", qd), self._array("v", v)
        return self._centripetal(q, 0.5 * (qd + v)) - self._centripetal(q, 0.5 * (qd - v))

    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return C(q,q̇) [N m s], (*batch, n, n), of Christoffel symbols: Ṁ − 2C is skew-symmetric."""
        q, qd = self._array("q", q)[..., None, :], self._array("qd", qd)[..., None, :]
        return self.coriolis(q, qd, np.eye(self.n)).swapaxes(-1, -2)

    def momentum(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return the generalized momentum p = M(q)q̇ [N m s], (*batch, n)."""
        q = self._array("q", q)
        return self._weightless.inverse_dynamics(q, np.zeros(q.shape), qd)

    def momentum_rate(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> Array:
        """Return ṗ = τ + C(q,q̇)ᵀq̇ − g(q) [N m], (*batch, n): the rate of the momentum p = M(q)q̇ under torques τ.

        It needs no acceleration, as Ṁ = C + Cᵀ (Lagrange's equation: C(q,q̇)ᵀq̇ is the gradient of the kinetic energy).
        """
        self._check_mass()
        model, data, shape = self.pinocchio_model, self._data, (self.n, self.n)

        def gradient(qi: Array, qdi: Array) -> Array:
            return qdi.dot(pin.computeCoriolisMatrix(model, data, qi, qdi).reshape(shape))

        return self._array("tau", tau) + self._each(q, (self.n,), gradient, qd=qd) - self.gravity(q)

    def kinetic_energy(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return the kinetic energy ½ q̇ᵀM(q)q̇ [J], (*batch,)."""
        qd = self._array("qd", qd)
        return 0.5 * np.asarray((self.momentum(q, qd) * qd).sum(-1))

    def potential_energy(self, q: ArrayLike) -> Array:
        """Return the energy in the field of gravity [J], (*batch,), zero with all mass at the base frame's height."""
        data = self._body.data
        return self._each(q, (), lambda qi: pin.computePotentialEnergy(self.pinocchio_model, data, qi))

    @cached_property
    def inertial_parameters(self) -> Array:
        """The parameters θ of the bodies that the joints move, ten each after one another, (10n,).

        For each body m [kg], m c (3) [kg m] and Ixx, Ixy, Iyy, Ixz, Iyz, Izz [kg m²], about the joint's frame and in
        its axes. What is fixed to a body, as a payload is, belongs to it.
        """
        return np.concatenate([body.toDynamicParameters() for body in list(self.pinocchio_model.inertias)[1:]])

    def torque_regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, velocity: ArrayLike | None = None) -> Array:
        """Return Y, (*batch, n, 10n), with Yθ the torque of :meth:`inverse_dynamics` for any inertial parameters θ.

        Rotor inertia is no part of it. (C. G. Atkeson, C. H. An and J. M. Hollerbach, Int. J. Robotics Research 5,
        1986, have the linearity; the Coriolis term with ``velocity`` is split as in :meth:`coriolis`.)
        """
        if velocity is None:
            return self._regress(self.pinocchio_model, q, qd, qdd)
        qd, v = self._array("qd", qd), self._array("velocity", velocity)
        surplus = self._regress(self._weightless.model, q, 0.5 * (qd - v), np.zeros(self.n))
        return self._regress(self.pinocchio_model, q, 0.5 * (qd + v), qdd) - surplus

    # --- kinematics -----------------------------------------------------------------------------------------

    def frame_pose(self, q: ArrayLike, frame: str) -> Array:
        """Return the pose of ``frame`` in the base frame [m], (*batch, 4, 4) homogeneous."""
        return self.frame_poses(q, [frame])[..., 0, :, :]

    def frame_poses(self, q: ArrayLike, frames: Sequence[str]) -> Array:
        """Return the poses of several frames in the base frame [m], (*batch, len(frames), 4, 4) homogeneous."""
        model, data, ids = self.pinocchio_model, self._data, [self.frame_id(frame) for frame in frames]
        array, solve, place = self._array("q", q), pin.forwardKinematics, pin.updateFramePlacement
        rows = array.reshape(-1, self.n)
        poses = np.empty((len(rows), len(ids), 4, 4))
        for qi, found in zip(rows, poses, strict=True):
            solve(model, data, qi)
            for k, i in enumerate(ids):
                found[k] = place(model, data, i).homogeneous
        return poses.reshape(*array.shape[:-1], len(ids), 4, 4)

    def frame_jacobian(self, q: ArrayLike, frame: str) -> Array:
        """Return the Jacobian of ``frame``, (*batch, 6, n): linear [m], then angular velocity, in the base's axes."""
        return self.frame_kinematics(q, frame)[1]

    def frame_kinematics(self, q: ArrayLike, frame: str) -> tuple[Array, Array]:
        """Return the pose of ``frame`` (*batch, 4, 4) and its Jacobian (*batch, 6, n), for the cost of one of them."""
        i, data, array = self.frame_id(frame), self._data, self._array("q", q)
        batch, rows = array.shape[:-1], array.reshape(-1, self.n)
        one = (6, self.n) if self.n > 1 else (6,)  # as the Jacobian of a single joint comes
        poses, jacobians, placement = np.empty((len(rows), 4, 4)), np.empty((len(rows), *one)), data.oMf[i]
        model, compute = self.pinocchio_model, pin.computeFrameJacobian
        for k, qi in enumerate(rows):
            jacobians[k] = compute(model, data, qi, i, _ALIGNED)
            poses[k] = placement.homogeneous  # which computeFrameJacobian leaves up to date
        return poses.reshape(*batch, 4, 4), jacobians.reshape(*batch, 6, self.n)

    def frame_motion(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, frame: str) -> tuple[Array, Array]:
        """Return velocity Jq̇ and acceleration Jq̈ + J̇q̇ of ``frame``, each (*batch, 6), for joint motion (q, q̇, q̈).

        Linear [m/s, m/s²], then angular [rad/s, rad/s²], in axes parallel to the base's, without gravity. The linear
        parts are those of the frame's origin, differentiated in the base frame (the "classical" acceleration).
        """
        model, data, i, axes = self.pinocchio_model, self._data, self.frame_id(frame), _ALIGNED
        arrays = broadcast(self.n, {"q": q, "qd": qd, "qdd": qdd}, self.joint_names)
        batch, rows = arrays[0].shape[:-1], [a.reshape(-1, self.n) for a in arrays]
        velocities, accelerations = np.empty((2, len(rows[0]), 6))
        for k, (qi, qdi, qddi) in enumerate(zip(*rows, strict=True)):
            pin.forwardKinematics(model, data, qi, qdi, qddi)
            velocities[k] = pin.getFrameVelocity(model, data, i, axes).vector
            accelerations[k] = pin.getFrameClassicalAcceleration(model, data, i, axes).vector
        return velocities.reshape(*batch, 6), accelerations.reshape(*batch, 6)

    # --- inside ---------------------------------------------------------------------------------------------

    @cached_property
    def _body(self) -> RigidBody:
        self._check_mass()
        return RigidBody(self.pinocchio_model, self.threads)

    @cached_property
    def _data(self) -> Any:
        return self.pinocchio_model.createData()

    @cached_property
    def _weightless(self) -> RigidBody:
        self._check_mass()
        model = pin.Model(self.pinocchio_model)
        model.gravity = pin.Motion.Zero()
        return RigidBody(model, self.threads)

    def _centripetal(self, q: ArrayLike, x: Array) -> Array:
        """Return c(q,x) = C(q,x)x [N m], (*batch, n)."""
        return self._weightless.inverse_dynamics(q, x, np.zeros_like(x))

    def _regress(self, model: Any, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return the torque regressor of a ``pin.Model``, (*batch, n, 10n)."""
        shape = (self.n, 10 * self.n)

        def regressor(qi: Array, qdi: Array, qddi: Array) -> Array:
            return pin.computeJointTorqueRegressor(model, self._data, qi, qdi, qddi).reshape(shape)

        return self._each(q, shape, regressor, qd=qd, qdd=qdd)

    def _each(self, q: ArrayLike, shape: tuple[int, ...], function: Callable[..., Any], **more: ArrayLike) -> Array:
        """Apply a ``function`` without a batched call to each configuration, with a row of each of ``more``."""
        arrays = broadcast(self.n, {"q": q, **more}, self.joint_names)
        batch, rows = arrays[0].shape[:-1], [a.reshape(-1, self.n) for a in arrays]
        values = np.empty((len(rows[0]), *shape))
        for k, row in enumerate(zip(*rows, strict=True)):
            values[k] = function(*row)
        return values.reshape(batch + shape)

    def _array(self, name: str, value: ArrayLike) -> Array:
        """Convert values of the joints to (*batch, n), ordered by name if they are labelled."""
        return as_joint_array(name, value, self.n, self.joint_names)

    @cached_property
    def _idle_joints(self) -> list[str]:
        """Names of the joints that would move no mass."""
        return idle_joints(self.pinocchio_model)

    def _check_mass(self) -> None:
        """Refuse to compute dynamics of an arm in which a joint moves no mass."""
        if not self.has_mass:
            raise UrdfError(
                f"{self.name}: no link has a mass, so there are kinematics and no dynamics; give some with "
                f"with_masses(kg={{{self.joint_names[0]!r}: 2.0, ...}}) or load_robot(..., estimated_inertia=True)"
            )
        if idle := self._idle_joints:
            raise UrdfError(
                f"{self.name}: {', '.join(idle)} would move no mass, so there are no dynamics; give some with "
                f"with_masses(kg={{{idle[-1]!r}: 2.0, ...}})",
                joint=idle[-1],
                value=list(idle),
            )

    def _support(self, frame: str) -> int:
        """Return the index of Pinocchio's joint that moves a frame; 0, the base, is refused."""
        i = self.pinocchio_model.frames[self.frame_id(frame)].parentJoint
        if i == 0:
            raise InputError(
                f"no joint of {self.name} moves the frame {frame!r}; give one farther out as tip", value=frame
            )
        return i


def build_model(text: str) -> Any:
    """Build the ``pin.Model`` of a URDF that has passed the checks of :mod:`pathcontrol.robot.urdf`."""
    try:
        model = pin.buildModelFromXML(text)
    except ValueError as error:  # the checks should have found it; say at least what Pinocchio says
        raise UrdfError(f"Pinocchio cannot build a model from this URDF: {error}") from error
    if model.nq != model.nv:
        raise UrdfError(
            f"{model.name} has joints that are not one angle or one length each; use a fixed-base arm", value=model.name
        )
    return model
