"""The rigid-body model of an arm, and the arms that are made of one: with a payload, locked joints, other friction.

Arrays have leading batch axes: q, q̇, τ are ``(*batch, n)`` in the order of ``joint_names``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import as_array, as_quantity, check_physical, check_rigid
from pathcontrol.arguments import Form, Point, Unit
from pathcontrol.errors import InputError, about, warn
from pathcontrol.robot.actuation import Actuation
from pathcontrol.robot.arm_dynamics import ArmDynamics
from pathcontrol.robot.bodies import check_spread, payload_of, scale_bodies
from pathcontrol.robot.friction import FrictionLaw, check_consistent, no_friction
from pathcontrol.robot.urdf.locking import check_tip, locked_angles, locked_beyond_limits, names_to_keep, read_angles
from pathcontrol.robot.urdf.xml.parse import parse_urdf


@dataclass(frozen=True, eq=False, repr=False)
class RobotModel(ArmDynamics):
    """The rigid-body model M(q)q̈ + C(q,q̇)q̇ + g(q) = τ of a fixed-base arm; see :func:`load_robot`.

    Instances are values: :meth:`with_payload`, :meth:`with_friction` and :meth:`reduced` return new ones. Friction is
    kept beside the rigid-body terms and enters none of them; the simulated plant and the controllers ask for it.

    Attributes:
        pinocchio_model: the underlying ``pin.Model``; do not change it.
        actuation: limits, friction law and encoders of the joints.
        source: the URDF it came from.
        threads: threads used by batched calls; results do not depend on it.
        steps: the methods that made it from the URDF's model, each with its arguments, fit for JSON; friction is not
            among them, as it is in ``actuation``.
        n: number of joints.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        # Pinocchio's pools cannot be pickled, the model they are made of can
        return RobotModel, (self.pinocchio_model, self.actuation, self.source, self.threads, self.steps)

    # --- variations -----------------------------------------------------------------------------------------

    def with_friction(self, friction: FrictionLaw | None) -> RobotModel:
        """Return the same arm with another friction law; ``None`` for no friction at all.

        Raises:
            InputError: the law is for another number of joints, or one of your own says different things in its
                methods, tried at a few velocities.
        """
        law = no_friction(self.n) if friction is None else friction
        if law.n != self.n:
            raise InputError(
                f"the friction law is for {law.n} joints, {self.name} has {self.n}", argument="friction", value=law
            )
        check_consistent(law)
        actuation = Actuation(self.limits, law, self.actuation.encoder_counts)
        return replace(self, actuation=actuation)

    def with_payload(
        self,
        mass: Annotated[float, Unit("kg")],
        frame: str,
        com: Point = (0.0, 0.0, 0.0),
        inertia: Annotated[ArrayLike, Form.POINTS, Unit("kg m^2")] | None = None,
    ) -> RobotModel:
        """Return the same arm carrying a rigid body.

        Args:
            mass: mass [kg].
            frame: the frame that carries it.
            com: centre of mass in that frame [m], shape (3,).
            inertia: inertia about the centre of mass, axes of that frame [kg m²], shape (3, 3); default a point mass.
                Of one that is symmetric up to rounding the symmetric part is taken.
        """
        self._check_mass()
        body = payload_of(mass, com, inertia)
        model = pin.Model(self.pinocchio_model)
        support = model.frames[self.frame_id(frame)]
        model.appendBodyToJoint(support.parentJoint, body, support.placement)
        check_spread(model, f"mass = {body.mass:g}, com = {body.lever.tolist()}")
        tensor = np.array(body.inertia)
        given = {"mass": body.mass, "frame": frame, "com": body.lever.tolist(), "inertia": tensor.tolist()}
        return self._with_model(model, "with_payload", given)

    def with_frame(self, name: str, parent: str, pose: ArrayLike) -> RobotModel:
        """Return the same arm with one additional frame, such as the tip of a tool.

        Args:
            name: its name, which no other frame has.
            parent: the frame that carries it.
            pose: its pose in ``parent`` [m], homogeneous (4, 4), or only the position of its origin, (3,).
        """
        if name in self.frame_names:
            raise InputError(
                f"{self.name} has a frame {name!r} already; choose another name", argument="name", value=name
            )
        model, given = pin.Model(self.pinocchio_model), check_physical("pose", as_array("pose", pose))
        if given.shape not in ((3,), (4, 4)):
            raise InputError(
                f"pose has shape {given.shape}, expected (4, 4), or (3,) for a position", argument="pose", value=pose
            )
        placement = pin.SE3(np.eye(3), given) if given.shape == (3,) else pin.SE3(check_rigid("pose", given, 1e-6))
        support = model.frames[self.frame_id(parent)]
        frame = pin.Frame(name, support.parentJoint, support.placement * placement, pin.FrameType.OP_FRAME)
        model.addFrame(frame, False)
        return self._with_model(model, "with_frame", {"name": name, "parent": parent, "pose": given.tolist()})

    def with_armature(self, armature: ArrayLike) -> RobotModel:
        """Return the same arm with rotor inertia [kg m²], shape (n,), added to the diagonal of M."""
        added = check_physical("armature", self._array("armature", armature))
        if added.shape != (self.n,) or (added < 0).any():
            raise InputError(
                f"armature = {added.tolist()}, expected {self.n} values not below 0",
                argument="armature",
                value=armature,
            )
        model = pin.Model(self.pinocchio_model)
        model.armature = np.asarray(model.armature) + added
        return self._with_model(model, "with_armature", {"armature": added.tolist()})

    def with_masses(
        self,
        scale: Mapping[str, float] | Sequence[float] | None = None,
        kg: Mapping[str, float] | Sequence[float] | None = None,
    ) -> RobotModel:
        """Return the same arm with heavier or lighter bodies; a body is all that moves with a joint, up to the next.

        Args:
            scale: factors on mass and inertia by the joint's name: ``{"joint_2": 1.1}`` for 10 % more, with the same
                centre of mass. A list has one for each joint.
            kg: masses [kg], likewise. A body that has one already keeps its form; one without becomes a rod
                from its joint to what is farthest on it.

        Raises:
            InputError: a factor of a body that has no mass, a number that is not above 0, or a factor and a mass of one
                joint.
        """
        model = pin.Model(self.pinocchio_model)
        factors, masses = self._positive("scale", scale), self._positive("kg", kg)
        for joint in (*factors, *masses):
            self.joint_index(joint)
        scale_bodies(model, self.joint_names, factors, masses)
        return self._with_model(model, "with_masses", {"scale": factors, "kg": masses})

    def _positive(self, name: str, given: Mapping[str, float] | Sequence[float] | None) -> dict[str, float]:
        """Return numbers above 0 by the names of joints, given such, or one for each joint."""
        if given is not None and not isinstance(given, Mapping):
            values = as_array(name, given)
            if values.shape != (self.n,):
                raise InputError(
                    f"{name} = {given!r}, expected numbers by joint, as {{{self.joint_names[0]!r}: 2.0}}, or one for "
                    f"each of the {self.n} joints",
                    argument=name,
                    value=given,
                )
            given = dict(zip(self.joint_names, values.tolist(), strict=True))
        found: dict[str, float] = {}
        for joint, value in (given or {}).items():
            with about(argument=name, joint=joint):
                found[joint] = as_quantity(f"{name} of {joint}", value)
        return found

    def with_threads(self, threads: int) -> RobotModel:
        """Return the same arm whose batched calls use ``threads`` threads."""
        return replace(self, threads=threads)

    def reduced(
        self, lock: Mapping[str, float] | None = None, *, keep: Sequence[str] = (), tip: str | None = None
    ) -> RobotModel:
        """Return the arm with some joints locked; the others keep their order.

        Args:
            lock: joints to lock, ``{"joint name": angle [rad]}``. Those that mimic them are locked with them.
            keep: names of joints that stay free: all others are locked, where ``lock`` does not say at 0, or at the
                limit nearest to 0.
            tip: a frame: as ``keep`` with all joints that move it.
        """
        check_tip(tip)
        for joint in (*(lock or {}), *names_to_keep(keep)):
            self.joint_index(joint)
        moving = None if tip is None else self.pinocchio_model.names[self._support(tip)]
        root = parse_urdf(self.source.text)
        angles = {j: at for j, at in locked_angles(root, lock, keep, moving).items() if j in self.joint_names}
        for sentence in locked_beyond_limits(root, angles, lock or ()):
            warn(sentence)
        return lock_joints(self, angles)

    def _with_model(self, model: Any, method: str, arguments: dict[str, Any]) -> RobotModel:
        """Return this arm with a changed model, and record the method that changed it."""
        return replace(self, pinocchio_model=model, steps=(*self.steps, (method, arguments)))


def lock_joints(robot: RobotModel, angles: Mapping[str, float]) -> RobotModel:
    """Return the arm with joints locked at ``angles`` [rad], by name, and only those: none that mimic them.

    Raises:
        InputError: an angle is not finite, or no joint is left.
        UnknownNameError: there is no such joint.
    """
    indices = {robot.joint_index(joint): angle for joint, angle in read_angles(angles).items()}
    if len(indices) == robot.n:
        raise InputError(
            f"locking all {robot.n} joints of {robot.name} leaves nothing to control; leave one free",
            value=list(angles),
        )
    q = np.zeros(robot.n)
    q[list(indices)] = list(indices.values())
    model = pin.buildReducedModel(robot.pinocchio_model, [i + 1 for i in indices], q)
    free = [i for i in range(robot.n) if i not in indices]
    steps = (*robot.steps, ("reduced", {"lock": dict(angles)}))
    return replace(robot, pinocchio_model=model, actuation=robot.actuation.select(free), steps=steps)
