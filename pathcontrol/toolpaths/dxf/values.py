"""Checked values of DXF entities, and their coordinate systems."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError

_WHOLE = 1e-4  # rad, how near a whole turn a sweep is one: programs write its end with few digits
_NO_ARC = 2e-6  # rad, a sweep up to this comes from ends a whole turn apart of which one was reduced


def common(entity: Any, name: str, default: Any) -> Any:
    """Return an attribute that all entities have, such as a layer, also of those that ezdxf does not know."""
    if entity.dxf.is_supported(name):
        return entity.dxf.get(name, default)
    known: dict[str, Any] = entity.graphic_properties() if hasattr(entity, "graphic_properties") else {}
    return known.get(name, default)


def layer_of(entity: Any) -> str:
    """Return the name of an entity's layer, ``"0"`` where it has none."""
    return str(common(entity, "layer", "0"))


def check_given(entity: Any, *names: str) -> None:
    """Check that the file gives all required attributes, which would otherwise be read as defaults."""
    missing = [name for name in names if not entity.dxf.hasattr(name)]
    if missing:
        raise ToolpathError(f"it has no {' and no '.join(missing)}", value=missing)


def number(entity: Any, name: str) -> float:
    """Return a number of an entity, from the file or the default of the format."""
    value = entity.dxf.get_default(name)
    if value is None or not np.isfinite(value):
        raise ToolpathError(f"its {name} is {value}, expected a finite number", value=value)
    return float(value)


def sweep_between(start: float, end: float) -> float:
    """Return the sweep of a counterclockwise arc from one angle to the other [rad], more than 0 up to 2π.

    Ends that are the same but for rounding are a whole turn apart: 0 and 6.2831855, 270° and 270°, 90° and 450.0001°.
    """
    sweep = (end - start) % (2 * np.pi)
    beyond = _NO_ARC if 0 <= end - start < np.pi else _WHOLE  # a short arc is allowed, one of several turns is not
    return 2 * np.pi if sweep <= beyond or 2 * np.pi - sweep <= _WHOLE else sweep


def vector(entity: Any, name: str) -> Array:
    """Return a point or direction of an entity, (3,)."""
    value = entity.dxf.get_default(name)
    if value is None or not np.isfinite(tuple(value)).all():
        raise ToolpathError(f"its {name} is {value}, expected finite coordinates", value=value)
    return np.array(tuple(value), dtype=np.float64)


def object_axes(entity: Any) -> Array:
    """Return the axes of the object coordinate system, as columns (3, 3), by the arbitrary axis algorithm."""
    normal = vector(entity, "extrusion")
    if not 0 < np.linalg.norm(normal) < np.inf:
        raise ToolpathError(f"its extrusion is {normal.tolist()}, expected a direction", value=normal)
    system = entity.ocs()
    return np.column_stack([system.ux, system.uy, system.uz])


def in_space(plane: Array) -> Array:
    """Return complex numbers x + iy as points (k, 3) with z = 0."""
    return np.column_stack([plane.real, plane.imag, np.zeros(len(plane))])
