"""The labels of the metrics, and their units."""

from __future__ import annotations

from typing import Any

from pathcontrol._expect import did_you_mean
from pathcontrol.errors import UnknownNameError

#: the unit of each metric
UNITS = {
    **{f"{name}_{kind}": "rad" for name in ("e_p", "lag_error", "contour_error") for kind in ("peak", "rms")},
    **{f"{name}_{kind}": "rad/s" for name in ("e_v",) for kind in ("peak", "rms")},
    **{f"gamma_distance_{kind}": "rad" for kind in ("peak", "rms")},
    "speed_ratio": "",
    "settling_time": "s",
    "tau_demand_peak": "N m",
    "tau_peak": "N m",
    "tau_demand_ratio": "",
    "tau_noise": "N m",
    "noise_amplification": "N m/rad",
    **{f"tool_deviation_{kind}": "m" for kind in ("peak", "rms")},
    "drawing_deviation_peak": "m",
    "smoothing_deviation": "m",
    **{f"tool_speed_{kind}": "m/s" for kind in ("mean", "peak")},
    "feed": "m/s",
    "orientation_error_peak": "rad",
    "path_time": "s",
    "lap_time": "s",
    "cut_time": "s",
    "end_error": "rad",
    "path_deviation_peak": "rad",
    "progress": "",
    "coverage": "",
    "position_limit_ratio": "",
    "velocity_limit_ratio": "",
    "torque_limit_ratio": "",
}
#: the label of each metric for a reader, in the order in which they are shown
LABELS = {
    "tool_deviation_peak": "tool from its path, peak",
    "tool_deviation_rms": "tool from its path, RMS",
    "drawing_deviation_peak": "drawing from the tool, peak",
    "smoothing_deviation": "smooth curves from the drawing",
    "e_p_peak": "‖e_p‖ peak",
    "e_p_rms": "‖e_p‖ RMS",
    "e_v_peak": "‖e_v‖ peak",
    "e_v_rms": "‖e_v‖ RMS",
    "contour_error_peak": "contour error, peak",
    "contour_error_rms": "contour error, RMS",
    "path_deviation_peak": "path from the arm, peak",
    "lag_error_peak": "lag error, peak",
    "lag_error_rms": "lag error, RMS",
    "gamma_distance_peak": "distance to Γ, peak",
    "gamma_distance_rms": "distance to Γ, RMS",
    "progress": "progress, share of what was asked for",
    "coverage": "coverage, share of the path that was passed",
    "tool_speed_mean": "tool speed, mean",
    "tool_speed_peak": "tool speed, peak",
    "feed": "feed asked for",
    "orientation_error_peak": "orientation of the tool, largest error",
    "speed_ratio": "speed, mean σ̇ over mean ϑ",
    "settling_time": "settling time of ‖e_p‖",
    "path_time": "time for the path",
    "lap_time": "time for a lap, mean",
    "cut_time": "time for the cuts",
    "end_error": "‖e_p‖ at the end",
    "position_limit_ratio": "position over its limit, peak",
    "velocity_limit_ratio": "velocity over its limit, peak",
    "torque_limit_ratio": "torque that acted over its limit, peak",
    "tau_demand_peak": "torque demand, peak",
    "tau_peak": "torque that acted, peak",
    "tau_demand_ratio": "torque demand over its limit, peak",
    "tau_noise": "noise of the torque demand",
    "noise_amplification": "noise of the torque over that of the position",
}


def check_metric_names(argument: str, wanted: Any, also: str = "") -> None:
    """Check that an ``argument`` names metrics; ``also`` says what else it may be.

    Raises:
        UnknownNameError: one of the names is no metric, or the argument is a text.
    """
    unknown = [wanted] if isinstance(wanted, str) else [name for name in wanted if name not in UNITS]
    if not unknown:
        return
    meant = "; put it in brackets" if isinstance(wanted, str) and wanted in UNITS else did_you_mean(unknown[0], UNITS)
    raise UnknownNameError(
        f"{argument} = {wanted!r}, expected a list of {', '.join(UNITS)}{also}{meant}",
        argument=argument,
        value=wanted,
        choices=tuple(UNITS),
    )
