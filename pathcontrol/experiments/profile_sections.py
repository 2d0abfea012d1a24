"""``profile`` of a task: a section for each velocity profile that it may be given instead of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.section import Section, Units, chooser
from pathcontrol.experiments.values import NotNegative, Numbers, Positive, Text


class RateProfile(Section):
    """``constant_rate``: ϑ(s) = ``rate`` [1/s], which no ``angle_unit`` applies to."""

    units: ClassVar[Units] = {"rate": "1/s"}
    type: Literal["constant_rate"] = "constant_rate"
    rate: Positive


class SpeedProfile(Section):
    """``constant_speed``: the path speed ‖q̇‖ = ``speed``, in ``angle_unit`` per second."""

    units: ClassVar[Units] = {"speed": "rad/s"}
    angles = ("speed",)
    type: Literal["constant_speed"] = "constant_speed"
    speed: Positive


class ToolSpeedProfile(Section):
    """``tool_speed``: the origin of ``frame`` moves at ``speed`` [m/s]; see :class:`pathcontrol.ToolSpeed`."""

    units: ClassVar[Units] = {"speed": "m/s"}
    type: Literal["tool_speed"] = "tool_speed"
    frame: Text
    speed: Positive


class LimitedProfile(Section):
    """``limited``: see :func:`pathcontrol.limited`, with one :class:`pathcontrol.MotionLimit`.

    With ``frame`` it is on the tool [m], else on the joints, in ``angle_unit``.
    """

    units: ClassVar[Units] = {"speed": "rad/s", "tangential": "rad/s^2", "normal": "rad/s^2", "chord_error": "rad"}
    angles = ("speed", "tangential", "normal", "chord_error")
    type: Literal["limited"] = "limited"
    frame: Text | None = None
    speed: Positive | None = None
    tangential: Positive | None = None
    normal: Positive | None = None
    chord_error: Positive | None = None

    @classmethod
    def units_of(cls, given: Mapping[str, Any]) -> Units:
        if given.get("frame") is None:
            return cls.units
        return {"speed": "m/s", "tangential": "m/s^2", "normal": "m/s^2", "chord_error": "m"}


class TimeOptimalProfile(Section):
    """``time_optimal``: see :func:`pathcontrol.time_optimal`; ``acceleration`` of each joint is in ``angle_unit``."""

    units: ClassVar[Units] = {"acceleration": "rad/s^2"}
    angles = ("acceleration",)
    type: Literal["time_optimal"] = "time_optimal"
    margin: NotNegative | None = None
    acceleration: Numbers | None = None


PROFILES: dict[str, type[Section]] = {
    "constant_rate": RateProfile,
    "constant_speed": SpeedProfile,
    "tool_speed": ToolSpeedProfile,
    "limited": LimitedProfile,
    "time_optimal": TimeOptimalProfile,
}
Profile = Annotated[
    RateProfile | SpeedProfile | ToolSpeedProfile | LimitedProfile | TimeOptimalProfile,
    PlainValidator(chooser("type", PROFILES)),
]
