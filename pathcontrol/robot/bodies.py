"""Bodies of a ``pin.Model``: made of numbers that people give, and made heavier or lighter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, finite, scalar
from pathcontrol.errors import InputError
from pathcontrol.robot.lump import rod

_ROUNDING = 1e-12  # of the largest moment, how far below zero a principal moment may be


def body_of(mass: float, com: Array, inertia: Array) -> Any:
    """Return the ``pin.Inertia`` of a mass [kg], a centre of mass [m], (3,), and an inertia about it [kg m²], (3, 3).

    Of the inertia the symmetric part is taken. Its constructor refuses moments below zero, which URDFs may have.

    Raises:
        InputError: they are too large to be floats.
    """
    inertia = 0.5 * inertia + 0.5 * inertia.T
    if not (np.isfinite(mass) and np.isfinite(inertia).all()):
        raise InputError("the mass or the inertia of a body is not finite; give masses in kg")
    body = pin.Inertia.Zero()
    body.mass, body.lever, body.inertia = mass, com, inertia
    return body


def payload_of(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> Any:
    """Return the ``pin.Inertia`` of a payload: its mass [kg], centre of mass [m], (3,), and inertia [kg m²], (3, 3).

    Raises:
        InputError: a shape is wrong, a number not finite, or the inertia not symmetric positive semi-definite but for
            rounding.
    """
    mass, lever = scalar("mass", mass, least=0.0), finite("com", as_array("com", com))
    tensor = np.zeros((3, 3)) if inertia is None else finite("inertia", as_array("inertia", inertia))
    if lever.shape != (3,) or tensor.shape != (3, 3):
        raise InputError(f"com has shape {lever.shape} and inertia {tensor.shape}, expected (3,) and (3, 3)")
    least = -_ROUNDING * max(1.0, float(np.abs(tensor).max()))
    if not np.allclose(tensor, tensor.T) or np.linalg.eigvalsh(0.5 * (tensor + tensor.T)).min() < least:
        raise InputError("the payload's inertia is not symmetric positive semi-definite")
    return body_of(mass, lever, tensor)


def scale_bodies(model: Any, names: tuple[str, ...], factors: Mapping[str, float], masses: Mapping[str, float]) -> None:
    """Change the bodies of a ``pin.Model`` in place, by factors or to masses [kg] of the joints that ``names`` lists.

    Raises:
        InputError: a joint has both, or the factor is of a body that has no mass.
    """
    if both := sorted(factors.keys() & masses.keys()):
        raise InputError(f"{', '.join(both)} has a scale and a mass in kg; give one of them")
    for joint, value in (*factors.items(), *masses.items()):
        i = names.index(joint) + 1
        body = model.inertias[i]
        if body.mass > 0:
            factor = value if joint in factors else value / body.mass
            model.inertias[i] = body_of(factor * body.mass, body.lever, factor * body.inertia)
        elif joint in masses:
            model.inertias[i] = body_of(*rod(value, _farthest(model, i)))
        else:
            raise InputError(f"scale of {joint} = {value:g}, but it moves no mass; say how many with kg={{...}}")


def idle_joints(model: Any) -> list[str]:
    """Return the names of the joints that have neither a rotor nor, from there to the tips, anything to move."""
    bodies, rotors = list(model.inertias), np.asarray(model.armature)
    heavy = [bool(body.mass or body.inertia.any()) for body in bodies]
    return [
        model.names[i]
        for i in range(1, len(bodies))
        if rotors[i - 1] == 0 and not any(heavy[k] for k in model.subtrees[i])
    ]


def _farthest(model: Any, i: int) -> Array:
    """Of the joints and frames on what joint ``i`` moves, return the place of the farthest [m], (3,)."""
    joints = [model.jointPlacements[k].translation for k in range(len(model.parents)) if model.parents[k] == i]
    frames = [frame.placement.translation for frame in model.frames if frame.parentJoint == i]
    return max((np.array(place) for place in (*joints, *frames)), key=lambda x: float(x @ x), default=np.zeros(3))
