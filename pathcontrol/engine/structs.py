"""The structs of ``src/setup.hpp``, ``arm.hpp`` and ``path.hpp``, field by field, and helpers to fill them."""

from __future__ import annotations

from ctypes import Structure, c_double, c_int, c_longlong, c_void_p
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import EngineError

MOST_JOINTS, MOST_STRIBECK, MOST_WALLS, MOST_RULES = 16, 4, 4, 8

_Doubles = c_void_p  # address of an array of doubles


class Arm(Structure):
    """Constants of an arm; see :class:`~pathcontrol.robot.constants.ArmConstants`."""

    _fields_ = [
        ("joints", c_int),
        ("parent", c_int * MOST_JOINTS),
        ("slides", c_int * MOST_JOINTS),
        ("rotation", c_double * 9 * MOST_JOINTS),
        ("origin", c_double * 3 * MOST_JOINTS),
        ("mass", c_double * MOST_JOINTS),
        ("moment", c_double * 3 * MOST_JOINTS),
        ("inertia", c_double * 6 * MOST_JOINTS),
        ("armature", c_double * MOST_JOINTS),
        ("gravity", c_double * 3),
    ]


class Path(Structure):
    """The table of a task; see :class:`~pathcontrol.engine.path_table.PathTable`."""

    _fields_ = [
        *((name, c_int) for name in ("joints", "cells", "buckets", "closed", "brakes")),
        *((name, c_double) for name in ("s0", "s_end", "period", "braking", "begin", "braking_back", "begin_back")),
        *((name, c_double) for name in ("arrival", "buckets_per_s")),
        *((name, _Doubles) for name in ("knots", "bucket", "coefficients", "centre", "radius")),
    ]


class Rows(Structure):
    """One row of values for each rollout, with the distance from one row to the next; 0: the same row for all."""

    _fields_ = [("data", _Doubles), ("stride", c_longlong)]


class FrictionRows(Structure):
    """Friction coefficients of each rollout."""

    _fields_ = [
        ("viscous", Rows),
        ("forward", Rows),
        ("backward", Rows),
        ("stribeck", c_longlong),
        ("fall", Rows * MOST_STRIBECK),
        ("velocity", Rows * MOST_STRIBECK),
    ]


class Arms(Structure):
    """Several arms, and the index of the arm that each rollout has."""

    _fields_ = [("arms", c_void_p), ("index", c_void_p)]


class Disturbance(Structure):
    """A push, a sinusoid, a force on a frame, a jam, a drop of torque limits or a wall."""

    _fields_ = [
        ("kind", c_int),
        ("body", c_int),
        ("offset", c_double * 3),
        ("arm", c_void_p),
        *((name, Rows) for name in ("magnitude", "start", "duration", "frequency", "phase")),
        *((name, Rows) for name in ("axes", "stiffness", "damping", "roughness")),
    ]


class Rule(Structure):
    """A rule for the speed along the path, of a wrapped law."""

    _fields_ = [
        *((name, c_int) for name in ("kind", "first", "input")),
        *((name, c_double) for name in ("acceleration", "pause")),
        ("threshold", Rows),
        ("torque", _Doubles),
        ("fastest", c_void_p),
        ("fastest_back", c_void_p),
    ]


class Setup(Structure):
    """All settings of a run."""

    _fields_ = [
        *((name, c_int) for name in ("joints", "law", "compensation", "branch", "finish", "ends_run", "laps")),
        *((name, c_int) for name in ("substeps", "parts", "delayed")),
        *((name, c_int) for name in ("encoders", "differentiates", "filters", "limited")),
        ("disturbances", c_int),
        *((name, c_int) for name in ("memory", "observes", "compensates", "rules", "inputs")),
        *((name, c_int) for name in ("jams", "drops", "walls")),
        ("period", c_double),
        ("part", c_double * 2),
        ("keep", c_double),
        ("capture", c_double),
        ("law_arms", Arms),
        ("plant_arms", Arms),
        ("paths", c_void_p),
        ("path_index", c_void_p),
        *((name, Rows) for name in ("position_gain", "velocity_gain", "plan_gain", "observer_gain")),
        *((name, Rows) for name in ("resolution", "torque_limit")),
        ("rule", c_void_p),
        ("law_friction", FrictionRows),
        ("plant_friction", FrictionRows),
        ("damped", Rows),
        ("disturbance", c_void_p),
        ("struck", c_void_p),
    ]


STATE = ("q", "qd", "q_read", "qd_read", "home_q", "home_qd", "queue")
STATE_NUMBERS = ("s", "first_s", "rest_since", "lap_start", "finish_time", "diverged_time", "reason")
MEMORY = ("memory", "first_memory")
SEEN_AND_SAID = ("q_seen", "qd_seen", "tau_said", "e_p_said", "e_v_said")
SAID_NUMBERS = ("s_said", "sdot_said")


class State(Structure):
    """Addresses of the arrays that hold the state of all rollouts."""

    _fields_ = [(name, _Doubles) for name in STATE + STATE_NUMBERS + MEMORY + SEEN_AND_SAID + SAID_NUMBERS]


RECORDED = ("q", "qd", "q_measured", "qd_measured", "tau_demand", "tau", "s", "sdot", "e_p", "e_v", "regular")


class Record(Structure):
    """Addresses at which the next samples are written, and the bytes from one sample to the next."""

    _fields_ = [*((name, c_void_p) for name in RECORDED), ("stride", c_longlong)]


class Span(Structure):
    """The ticks that one call takes."""

    _fields_ = [
        *((name, c_longlong) for name in ("law_tick", "arm_tick", "ticks", "rollouts")),
        ("last", c_int),
        ("stops", c_int),
        ("missed", c_void_p),
        ("stale", c_void_p),
        ("inputs", c_void_p),
    ]


class Gamma(Structure):
    """The curve Γ of a task, with its bounds."""

    _fields_ = [
        ("path", c_void_p),
        ("weight", c_double),
        ("brakes", c_int),
        ("centre", _Doubles),
        ("radius", _Doubles),
        ("pieces", c_void_p),
        ("length", _Doubles),
        ("straight", _Doubles),
        ("smooth", c_void_p),
    ]


class Tick(Structure):
    """A law for one arm at a time ``t`` [s], its values and those of its speed inputs."""

    _fields_ = [
        ("setup", c_void_p),
        *((name, _Doubles) for name in ("io", "memory", "inputs", "most")),
        ("t", c_double),
    ]


#: the structs whose sizes ``pathcontrol_layout`` returns, in its order
LAYOUT = (Arm, Path, Disturbance, Rule, Setup, State, Record, Span, Gamma, Tick)


class Memory:
    """Arrays and structs whose addresses C++ holds, kept alive together."""

    def __init__(self) -> None:
        self._kept: list[Any] = []

    def keep(self, value: Any) -> Any:
        """Keep ``value`` alive and return it."""
        self._kept.append(value)
        return value

    def address(self, array: Any, dtype: Any = np.float64) -> int:
        """Return the address of a contiguous copy, or of the array itself where it is one."""
        return self.keep(np.ascontiguousarray(array, dtype=dtype)).ctypes.data

    def rows(self, values: Any, columns: int) -> Rows:
        """Return values (), (columns,), (N, 1) or (N, columns) as rows of ``columns`` numbers."""
        array = np.asarray(values, dtype=np.float64)
        several = array.ndim > 1 and len(array) > 1
        if array.shape[-1:] != (columns,):
            array = np.broadcast_to(array, (len(array) if several else 1, columns))
        return Rows(self.address(array), columns if several else 0)

    def numbers(self, values: Any) -> Rows:
        """Return values () or (N,) as rows of one number."""
        array = np.asarray(values, dtype=np.float64).reshape(-1)
        return Rows(self.address(array), 1 if len(array) > 1 else 0)


def address_of(array: NDArray[Any]) -> int:
    """Return the address of an array that lies row after row, as the engine reads it.

    Raises:
        EngineError: it lies in another order, of which a copy of a repeated row may be.
    """
    if not array.flags.c_contiguous:
        raise EngineError(
            f"an array of shape {array.shape} with strides {array.strides} does not lie row after row",
            value=array.strides,
        )
    return array.ctypes.data


def fill(field: Any, values: Array) -> None:
    """Copy an array into the beginning of an array field of doubles or ints."""
    flat = np.ascontiguousarray(values).reshape(-1)
    kind = np.float64 if flat.dtype.kind == "f" else np.int32
    np.frombuffer(field, dtype=kind)[: flat.size] = flat
