"""``[controller]`` and ``[loop]``: a section for each control law, and for each way to close the loop."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.section import Section, chooser
from pathcontrol.experiments.values import FlagOrLimits, Gain, Number, Positive, Whole


class ControllerSection(Section):
    """What every control law takes."""

    friction: Literal["none", "viscous", "full"] | None = None
    start: Literal["s0", "nearest"] | None = None


class ExtendedMotionPlanController(ControllerSection):
    """``extended_motion_plan``: see :class:`pathcontrol.ExtendedMotionPlan`."""

    type: Literal["extended_motion_plan"] = "extended_motion_plan"
    K_p: Gain
    K_v: Gain
    k: Number


class ProjectionController(ControllerSection):
    """``projection``: see :class:`pathcontrol.Projection`."""

    angles = ("capture",)
    type: Literal["projection"] = "projection"
    k_p: Gain
    K_v: Gain
    branch: Literal["follow", "nearest", "local"] | None = None
    capture: Positive | None = None


class ComputedTorqueController(ControllerSection):
    """``computed_torque``: see :class:`pathcontrol.ComputedTorque`."""

    type: Literal["computed_torque"] = "computed_torque"
    K_p: Gain
    K_v: Gain


class PDPlusController(ControllerSection):
    """``pd_plus``: see :class:`pathcontrol.PDPlus`."""

    type: Literal["pd_plus"] = "pd_plus"
    K_p: Gain
    K_v: Gain


class SlotineLiController(ControllerSection):
    """``slotine_li``: see :class:`pathcontrol.SlotineLi`."""

    type: Literal["slotine_li"] = "slotine_li"
    Lambda: Gain
    K_d: Gain


class SampledSection(Section):
    """``sampled``: see :class:`pathcontrol.SampledLoop`."""

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
