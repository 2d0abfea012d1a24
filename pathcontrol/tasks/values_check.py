"""The check of what the methods of a task return: shapes and values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError


def check_path(path: Any, s: Array) -> None:
    """Check shapes and values of q_d and q_d' of a path, of any number of joints, at s (m,).

    Raises:
        TaskError: a shape is wrong, or a value not a finite number.
    """
    name = type(path).__name__
    n = count_joints(path, name, s[0])
    for method in ("q_d", "dq_d"):
        check_values(f"{name}.{method}", getattr(path, method), s, n)


def count_joints(task: Any, name: str, s: float) -> int:
    """Return the number of joints that q_d is for."""
    posture = evaluate(f"{name}.q_d", task.q_d, np.float64(s))
    if posture.ndim != 1:
        raise TaskError(
            f"{name}.q_d of a number s has shape {posture.shape}, expected (n,): a value for each joint",
            value=posture.shape,
            s=float(s),
        )
    return len(posture)


def check_values(label: str, function: Callable[[Any], Any], s: Array, n: int | None) -> Array:
    """Check that values at s and at a single s have the shapes of the batch convention; return them."""
    many, _ = (_check_shape(label, function, argument, n) for argument in (s, s[0]))
    values = np.asarray(many, dtype=np.float64) + (np.zeros_like(s) if n is None else 0.0)
    if not np.isfinite(values).all():
        i = int(np.argwhere(~np.isfinite(values))[0][0])
        raise TaskError(
            f"{label}(s={s[i]:g}) = {values[i].tolist()}, expected finite numbers on the whole domain",
            value=values[i].tolist(),
            s=float(s[i]),
        )
    return values


def _check_shape(label: str, function: Callable[[Any], Any], s: Any, n: int | None) -> Array:
    """Check that values at s have the shape of the batch convention; return them."""
    expected = np.shape(s) + (() if n is None else (n,))
    value = evaluate(label, function, s)
    # ϑ may be a constant that broadcasts
    if value.shape != expected and not (n is None and value.shape == ()):
        raise TaskError(_shape_message(label, np.shape(s), value.shape, expected, n), value=value.shape)
    return value


def evaluate(label: str, function: Callable[[Any], Any], s: Any) -> Array:
    """Return what a method of the task gives at s, an array of real numbers."""
    try:
        value = function(s)
        array = np.asarray(value)
    except TaskError:
        raise
    except (TypeError, ValueError, IndexError) as error:
        raise TaskError(
            f"{label} fails for s of shape {np.shape(s)}: {error}; work on arrays, with np.cos rather than math.cos "
            "and np.where rather than if"
        ) from error
    if value is None:
        raise TaskError(f"{label} returns None, expected an array; does it end without a return?")
    if array.dtype.kind not in "biufO":
        raise TaskError(
            f"{label} gives {array.dtype} numbers, expected real ones"
            if array.dtype.kind == "c"
            else f"{label} gives {value!r:.80}, expected an array of numbers",
            value=value,
        )
    return array


def _shape_message(label: str, given: Any, got: Any, expected: Any, n: int | None) -> str:
    message = f"{label} of s with shape {given} has shape {got}, expected {expected}"
    if n is not None and len(got) == len(expected) and got[:-1] == expected[:-1]:
        return message + f": the path is for {got[-1]} joints, the arm has {n}"
    return message + "; work on arrays and put the joints last, as in np.stack([...], axis=-1)"
