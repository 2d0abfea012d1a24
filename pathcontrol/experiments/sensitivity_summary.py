"""The summary of the combinations: how often the paper's peaks come out, and what each setting alone does to them."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array
from pathcontrol.experiments.reproduce import PAPER
from pathcontrol.experiments.sensitivity import SINGLE, WINDOWS
from pathcontrol.sweeps.result import SweepResult

#: within what share of the paper's peaks
NEAR = (0.05, 0.10, 0.20)
_SIGNALS = {"e_p_peak_deg": "e_p", "e_v_peak_deg_s": "e_v"}
_CLOUD = 1 + len(SINGLE)  # the first combination of several changes

#: peaks by experiment and name, of each combination (combination,), in degrees and degrees per second
Peaks = dict[str, dict[str, Array]]


def peaks_of(result: SweepResult) -> Peaks:
    """Return the four peaks of each combination, in the window that it takes for the steady state."""
    table = result.table()
    return {name: _peaks(table.isel(sample=(table["experiment"] == name).to_numpy())) for name in PAPER}


def _peaks(table: xr.Dataset) -> dict[str, Array]:
    ordered = table.isel(sample=np.argsort(table["combination"].to_numpy()))
    windows = ordered["window"].to_numpy().astype(str)
    return {peak: np.rad2deg(_chosen(ordered, signal, windows)) for peak, signal in _SIGNALS.items()}


def _chosen(table: xr.Dataset, signal: str, windows: Array) -> Array:
    """Return the peak of a signal in the window of each row."""
    return np.select([windows == name for name in WINDOWS], [table[f"{signal} {name}"].to_numpy() for name in WINDOWS])


def cloud_of(peaks: Peaks) -> Peaks:
    """Return the peaks of the combinations in which several settings change."""
    return {name: {peak: values[_CLOUD:] for peak, values in own.items()} for name, own in peaks.items()}


def furthest(peaks: Peaks) -> Array:
    """Return the largest of the four differences from the paper's peaks, as a share of them, of each combination."""
    shares = [abs(values / PAPER[name][peak] - 1) for name, own in peaks.items() for peak, values in own.items()]
    return np.max(shares, axis=0)


def velocity_ratio(peaks: Peaks) -> Array:
    """Return the peak of ‖e_v‖ of projection over that of the extended motion plan, of each combination."""
    return peaks["projection"]["e_v_peak_deg_s"] / peaks["extended_motion_plan"]["e_v_peak_deg_s"]


def summarise(peaks: Peaks) -> dict[str, Any]:
    """Return fractions, spreads and effects of single settings, as JSON has them."""
    cloud = cloud_of(peaks)
    apart, ratio = furthest(cloud), velocity_ratio(cloud)
    paper_ratio = PAPER["projection"]["e_v_peak_deg_s"] / PAPER["extended_motion_plan"]["e_v_peak_deg_s"]
    return {
        "samples": len(apart),
        "fractions": {f"all_four_within_{100 * near:.0f}_percent": float((apart <= near).mean()) for near in NEAR},
        "nominal": _of_each(peaks, lambda values, paper: float(values[0])),
        "spread": _of_each(cloud, lambda values, paper: _spread(values) | _within(values, paper)),
        "effects": [
            {"setting": setting, "value": value} | {"change_percent": _changes(peaks, 1 + i)}
            for i, (setting, value, _) in enumerate(SINGLE)
        ],
        "e_v_ratio": {
            "paper": paper_ratio,
            "nominal": float(velocity_ratio(peaks)[0]),
            **_spread(ratio),
            "fraction_that_reaches_the_paper": float((ratio >= paper_ratio).mean()),
        },
    }


def _of_each(peaks: Peaks, function: Any) -> dict[str, dict[str, Any]]:
    """Return a function of the values of each peak and of what the paper says."""
    return {
        name: {peak: function(values, PAPER[name][peak]) for peak, values in own.items()} for name, own in peaks.items()
    }


def _spread(values: Array) -> dict[str, float]:
    return {"least": float(values.min()), "median": float(np.median(values)), "largest": float(values.max())}


def _within(values: Array, paper: float) -> dict[str, float]:
    return {"fraction_within_10_percent": float((abs(values / paper - 1) <= 0.10).mean())}


def _changes(peaks: Peaks, row: int) -> dict[str, dict[str, float]]:
    """Return the changes of the nominal peaks by a combination, in per cent."""
    return _of_each(peaks, lambda values, paper: float(100 * (values[row] / values[0] - 1)))
