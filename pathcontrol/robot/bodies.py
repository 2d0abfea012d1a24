"""Rigid bodies of a ``pin.Model``: made from mass, centre and inertia, scaled, and checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_quantity, as_scalar, check_physical
from pathcontrol.errors import InputError
from pathcontrol.robot.lump import rod

_SPREAD = 1e12  # largest ratio of the inertias of the bodies of one arm
_ROUNDING = 1e-12  # of the largest moment, how far below zero a principal moment may be


def body_of(mass: float, com: Array, inertia: Array) -> Any:
    """Return the ``pin.Inertia`` of a mass [kg], a centre of mass [m], (3,), and an inertia about it [kg m²], (3, 3).

    Of the inertia the symmetric part is taken. Its constructor refuses moments below zero, which URDFs may have.

    Raises:
        InputError: they are too large or too small for dynamics in floats.
    """
    inertia = 0.5 * inertia + 0.5 * inertia.T
    check_physical("com", com)
    if mass:
        as_quantity("mass", mass)
    check_physical("inertia", inertia)
    body = pin.Inertia.Zero()
    body.mass, body.lever, body.inertia = mass, com, inertia
    return body


def payload_of(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> Any:
    """Return the ``pin.Inertia`` of a payload: its mass [kg], centre of mass [m], (3,), and inertia [kg m²], (3, 3).

    Raises:
        InputError: a shape is wrong, a number not finite, or the inertia not symmetric positive semi-definite but for
            rounding.
    """
    mass, lever = as_scalar("mass", mass, least=0.0), check_physical("com", as_array("com", com))
    tensor = np.zeros((3, 3)) if inertia is None else check_physical("inertia", as_array("inertia", inertia))
    if lever.shape != (3,) or tensor.shape != (3, 3):
        argument, value = ("com", com) if lever.shape != (3,) else ("inertia", inertia)
        raise InputError(
            f"com has shape {lever.shape} and inertia {tensor.shape}, expected (3,) and (3, 3)",
            argument=argument,
            value=value,
        )
    least = -_ROUNDING * max(1.0, float(np.abs(tensor).max()))
    if not np.allclose(tensor, tensor.T) or np.linalg.eigvalsh(0.5 * (tensor + tensor.T)).min() < least:
        raise InputError(
            "the payload's inertia is not symmetric positive semi-definite", argument="inertia", value=inertia
        )
    return body_of(mass, lever, tensor)


def scale_bodies(model: Any, names: tuple[str, ...], factors: Mapping[str, float], masses: Mapping[str, float]) -> None:
    """Change the bodies of a ``pin.Model`` in place, by factors or to masses [kg] of the joints that ``names`` lists.

    Raises:
        InputError: a joint has both, or the factor is of a body that has no mass.
    """
    if both := sorted(factors.keys() & masses.keys()):
        raise InputError(f"{', '.join(both)} has a scale and a mass in kg; give one of them", joint=both[0])
    for joint, value in (*factors.items(), *masses.items()):
        i, argument = names.index(joint) + 1, "scale" if joint in factors else "kg"
        try:
            model.inertias[i] = _scale_body(model, i, value, argument)
        except InputError as error:
            raise InputError(
                f"{argument} of {joint} = {value:g}: {error}",
                **error.details_with(argument=argument, joint=joint, value=value),
            ) from error
    given = [*(f"scale of {joint} = {value:g}" for joint, value in factors.items())]
    given += [f"kg of {joint} = {value:g}" for joint, value in masses.items()]
    check_spread(model, ", ".join(given))


def _scale_body(model: Any, i: int, value: float, argument: str) -> Any:
    """Return the body ``i`` of a ``pin.Model`` times a factor, ``scale``, or brought to a mass, ``kg``."""
    body = model.inertias[i]
    if body.mass > 0:
        factor = value if argument == "scale" else value / body.mass
        return body_of(factor * body.mass, body.lever, factor * body.inertia)
    if argument == "scale":
        raise InputError("it moves no mass; say how many with kg={...}")
    return body_of(*rod(value, _farthest_point(model, i)))


def check_spread(model: Any, given: str) -> None:
    """Check that the bodies of a ``pin.Model`` are of similar size, so that M(q) is not singular by rounding.

    What was ``given`` to make them so begins the message.

    Raises:
        InputError: one counts for more than 1e12 times what another does.
    """
    names = list(model.names)
    felt = {names[i]: _felt_inertia(body) for i, body in enumerate(model.inertias) if i and body.mass > 0}
    most, least = (choose(felt, key=felt.__getitem__, default="") for choose in (max, min))
    if felt and felt[most] > _SPREAD * felt[least]:
        raise InputError(
            f"{given}: what {most} moves has {felt[most] / felt[least]:.3g} times the inertia of what {least} moves, "
            f"which is lost in rounding; expected {_SPREAD:g} times at most",
            joint=most,
            value=felt[most] / felt[least],
            limit=_SPREAD,
        )


def _felt_inertia(body: Any) -> float:
    """Return the inertia that a body has for joints a metre away: m (1 + c²) + tr I."""
    lever = np.asarray(body.lever)
    return float(body.mass * (1.0 + lever @ lever) + np.trace(body.inertia))


def idle_joints(model: Any) -> list[str]:
    """Return the names of the joints without a rotor that have, from there to the tips, no mass to move."""
    bodies, rotors = list(model.inertias), np.asarray(model.armature)
    heavy = [bool(body.mass or body.inertia.any()) for body in bodies]
    return [
        model.names[i]
        for i in range(1, len(bodies))
        if rotors[i - 1] == 0 and not any(heavy[k] for k in model.subtrees[i])
    ]


def _farthest_point(model: Any, i: int) -> Array:
    """Return the position [m], (3,), of the joint or frame carried by joint ``i`` that is farthest from it."""
    joints = [model.jointPlacements[k].translation for k in range(len(model.parents)) if model.parents[k] == i]
    frames = [frame.placement.translation for frame in model.frames if frame.parentJoint == i]
    return max((np.array(place) for place in (*joints, *frames)), key=lambda x: float(x @ x), default=np.zeros(3))
