"""The classes that experiment files, saved runs and reports name, by kind.

A class of the library has a line here, which is all that it needs beside its own file; these lines are the only code
that a file can name by itself. A class of a user enters by being defined: its base knows its subclasses.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any


@dataclass(frozen=True)
class Kind:
    """The classes that derive from one base, and functions that make instances of them.

    Attributes:
        base: where the base class is, in this package; empty where users have none of their own.
        members: where those of the library are, by the names that files have for them.
        given: names of parameters that are in no file: the arm, and what a law or a profile is for.
    """

    base: str
    members: Mapping[str, str]
    given: tuple[str, ...] = ()

    def find(self, name: str) -> Callable[..., Any] | None:
        """Return the class with a name, as files have it or as Python has it, or ``None``; the library comes first."""
        of_library = next((at for key, at in self.members.items() if name in (key, _last(at))), None)
        return load(of_library) if of_library else self.defined().get(name)

    def defined(self) -> dict[str, Any]:
        """Return the classes that users have defined so far, by their names; of equal names the last one."""
        found: Iterator[type] = _subclasses(load(self.base)) if self.base else iter(())
        own = (cls for cls in found if not cls.__module__.startswith(f"{__package__}."))
        return {cls.__name__: cls for cls in own if not inspect.isabstract(cls)}

    def has(self, name: str) -> bool:
        """Return whether the library has a class of this name, as Python has it."""
        return name in map(_last, self.members.values())


LAWS = Kind(
    "control.base:Controller",
    {
        "extended_motion_plan": "control.extended_motion_plan:ExtendedMotionPlan",
        "projection": "control.projection:Projection",
        "computed_torque": "control.motion_control:ComputedTorque",
        "pd_plus": "control.motion_control:PDPlus",
        "slotine_li": "control.motion_control:SlotineLi",
        "adaptive_slotine_li": "control.adaptive_slotine_li:AdaptiveSlotineLi",
        "passive_velocity_field": "control.passive_velocity_field:PassiveVelocityField",
        "transverse_linearization": "control.transverse_linearization:TransverseLinearization",
        "maneuver_regulation": "control.maneuver_regulation:ManeuverRegulation",
        "speed_override": "control.wrappers.speed_override:SpeedOverride",
        "paced": "control.wrappers.paced:Paced",
        "event_plan": "control.wrappers.event_plan:EventPlan",
        "path_mpc": "control.mpc.path_mpc:PathMPC",
        "learned": "control.learning.learned:Learned",
    },
    ("robot", "task"),
)
TASKS = Kind(
    "tasks.task:PathTask",
    {
        "circle": "tasks.curves:Circle",
        "ellipse": "tasks.curves:Ellipse",
        "lissajous": "tasks.curves:Lissajous",
        "line": "tasks.curves:Line",
        "waypoint_path": "tasks.waypoints:WaypointPath",
        "symbolic_path": "tasks.symbolic.symbolic_path:SymbolicPath",
        "cartesian_path": "cartesian.cartesian_path:CartesianPath",
    },
    ("robot",),
)
PROFILES = Kind(
    "tasks.profile:VelocityProfile",
    {
        "constant_rate": "tasks.profile:ConstantRate",
        "constant_speed": "tasks.profile:ConstantSpeed",
        "tool_speed": "profiles.tool_speed:ToolSpeed",
        "limited": "profiles.limited.limited:limited_motion",
        "time_optimal": "profiles.topp.time_optimal:time_optimal",
        "smooth_start_stop": "profiles.jerk.start_stop:SmoothStartStop",
    },
    ("robot", "path"),
)
MOTIONS = Kind(
    "profiles.motion:Motion",
    {"joint_motion": "profiles.motion:JointMotion", "tool_motion": "profiles.motion:ToolMotion"},
    ("robot",),
)
CURVES = Kind(
    "toolpaths.tool_curve:ToolCurve",
    {
        "line": "toolpaths.tool_curve:ToolCurve.line",
        "circle": "toolpaths.tool_curve:ToolCurve.circle",
        "spline": "toolpaths.tool_curve:ToolCurve.spline",
        "polyline": "toolpaths.tool_curve:ToolCurve.polyline",
    },
)
ORIENTATIONS = Kind(
    "cartesian.orientation:Orientation",
    {
        "fixed": "cartesian.orientation:FixedOrientation",
        "tangent": "cartesian.orientation:TangentOrientation",
        "normal": "cartesian.orientation:NormalOrientation",
    },
)
FRICTION_LAWS = Kind(
    "robot.friction:FrictionLaw",
    {
        "viscous": "robot.friction:Viscous",
        "coulomb": "robot.friction:Coulomb",
        "stribeck": "robot.friction:Stribeck",
    },
)
DISTURBANCES = Kind(
    "simulation.arm.disturbance:Disturbance",
    {
        "push": "simulation.arm.disturbance:Push",
        "harmonic": "simulation.arm.disturbance:Harmonic",
        "frame_force": "simulation.arm.disturbance:FrameForce",
        "jammed_joint": "simulation.arm.jam:JammedJoint",
        "pick_up": "simulation.arm.pick_up:PickUp",
        "wall": "simulation.arm.wall:Wall",
        "dropout": "simulation.arm.dropout:Dropout",
        "friction_change": "simulation.arm.friction_change:FrictionChange",
        "torque_limit_drop": "simulation.arm.torque_limit_drop:TorqueLimitDrop",
    },
    ("robot",),
)
LOOPS = Kind("", {"sampled": "simulation.loops:SampledLoop", "continuous": "simulation.loops:ContinuousTime"})
KINDS = (LAWS, TASKS, PROFILES, MOTIONS, CURVES, ORIENTATIONS, FRICTION_LAWS, DISTURBANCES)


def load(place: str) -> Any:
    """Return what is at a ``place`` in this package, such as ``tasks.curves:Circle``."""
    return resolve_name(f"{__package__}.{place}")


def find_kind(base: Any) -> Kind | None:
    """Return the kind whose base a class is, or ``None``."""
    place = f"{getattr(base, '__module__', '')}:{getattr(base, '__qualname__', '')}"
    return next((kind for kind in KINDS if place == f"{__package__}.{kind.base}"), None)


def _last(place: str) -> str:
    """Return the name at the end of a place."""
    return re.split(r"[.:]", place)[-1]


def _subclasses(base: type) -> Iterator[type]:
    """Yield all that derives from ``base``, in the order in which it was defined."""
    below: list[type] = base.__subclasses__()
    for cls in below:
        yield cls
        yield from _subclasses(cls)
