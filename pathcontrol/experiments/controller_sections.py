"""``[controller]`` and ``[loop]``: a section for each control law, and for each way to close the loop."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.section import Section, Units, chooser
from pathcontrol.experiments.values import FlagOrLimits, Gain, Number, Positive, Whole


class ControllerSection(Section):
    """What every control law takes."""

    friction: Literal["none", "viscous", "full"] | None = None
    start: Literal["s0", "nearest"] | None = None


class ExtendedMotionPlanController(ControllerSection):
    """``extended_motion_plan``: see :class:`pathcontrol.ExtendedMotionPlan`."""

    units: ClassVar[Units] = {"K_p": "1/s^2", "K_v": "1/s", "k": "1/rad^2/s"}
    type: Literal["extended_motion_plan"] = "extended_motion_plan"
    K_p: Gain
    K_v: Gain
    k: Number


class ProjectionController(ControllerSection):
    """``projection``: see :class:`pathcontrol.Projection`."""

    units: ClassVar[Units] = {"k_p": "1/s^2", "K_v": "1/s", "capture": "rad"}
    angles = ("capture",)
    type: Literal["projection"] = "projection"
    k_p: Gain
    K_v: Gain
    branch: Literal["follow", "nearest", "local"] | None = None
    capture: Positive | None = None


class ComputedTorqueController(ControllerSection):
    """``computed_torque``: see :class:`pathcontrol.ComputedTorque`."""

    units: ClassVar[Units] = {"K_p": "1/s^2", "K_v": "1/s"}
    type: Literal["computed_torque"] = "computed_torque"
    K_p: Gain
    K_v: Gain


class PDPlusController(ControllerSection):
    """``pd_plus``: see :class:`pathcontrol.PDPlus`."""

    units: ClassVar[Units] = {"K_p": "N m/rad", "K_v": "N m s/rad"}
    type: Literal["pd_plus"] = "pd_plus"
    K_p: Gain
    K_v: Gain


class SlotineLiController(ControllerSection):
    """``slotine_li``: see :class:`pathcontrol.SlotineLi`."""

    units: ClassVar[Units] = {"Lambda": "1/s", "K_d": "N m s/rad"}
    type: Literal["slotine_li"] = "slotine_li"
    Lambda: Gain
    K_d: Gain


class SampledSection(Section):
    """``sampled``: see :class:`pathcontrol.SampledLoop`."""

    units: ClassVar[Units] = {"period": "s", "filter_hz": "Hz", "torque_limits": ("N m", "N"), "delay": "s"}
    mode: Literal["sampled"] = "sampled"
    period: Positive | None = None
    substeps: Whole | None = None
    encoders: FlagOrLimits | None = None
    velocity: Literal["exact", "difference"] | None = None
    filter_hz: Positive | None = None
    torque_limits: FlagOrLimits | None = None
    delay: Number | None = None


class ContinuousSection(Section):
    """``continuous``: see :class:`pathcontrol.ContinuousTime`."""

    units: ClassVar[Units] = {"output_period": "s", "friction_width": "rad/s", "torque_limits": ("N m", "N")}
    angles = ("friction_width",)
    mode: Literal["continuous"] = "continuous"
    output_period: Positive | None = None
    rtol: Positive | None = None
    atol: Positive | None = None
    friction_width: Positive | None = None
    torque_limits: FlagOrLimits | None = None


LAWS: dict[str, type[Section]] = {
    "extended_motion_plan": ExtendedMotionPlanController,
    "projection": ProjectionController,
    "computed_torque": ComputedTorqueController,
    "pd_plus": PDPlusController,
    "slotine_li": SlotineLiController,
}
LOOPS: dict[str, type[Section]] = {"sampled": SampledSection, "continuous": ContinuousSection}

Law = Annotated[
    ExtendedMotionPlanController
    | ProjectionController
    | ComputedTorqueController
    | PDPlusController
    | SlotineLiController,
    PlainValidator(chooser("type", LAWS)),
]
Loop = Annotated[SampledSection | ContinuousSection, PlainValidator(chooser("mode", LOOPS, default="sampled"))]
