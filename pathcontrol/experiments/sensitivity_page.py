"""The page "How sure is this?": sentences, a figure and tables of both experiments in many combinations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._files import write_whole
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.experiments.reproduce import PAPER
from pathcontrol.experiments.sensitivity import SAMPLES, run_combinations
from pathcontrol.experiments.sensitivity_summary import (
    Peaks,
    cloud_of,
    furthest,
    peaks_of,
    summarise,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BOX = 0.10  # of the paper's peaks
_TITLES = {"extended_motion_plan": "extended motion plan", "projection": "projection"}
_PEAKS = {"e_p_peak_deg": ("‖e_p‖", "deg"), "e_v_peak_deg_s": ("‖e_v‖", "deg/s")}


def sensitivity(out: str | Path, samples: int = SAMPLES, progress: bool = True) -> dict[str, Any]:
    """Simulate the paper's experiments with what it leaves unsaid varied, and say how sure the reproduction is.

    Writes ``sensitivity.html``, ``sensitivity.svg``, ``sensitivity.png`` and ``sensitivity.json`` to the folder
    ``out``, and the sweep itself to ``sensitivity/`` there. What an interrupted call has simulated is not done again.

    Args:
        out: a folder, made if need be.
        samples: the number of combinations in which several settings differ.
        progress: show a bar on standard error when it takes longer than two seconds.

    Returns:
        What ``sensitivity.json`` holds: ``fractions`` of the combinations that come near the paper's four peaks, the
        ``spread`` of each peak, the ``effects`` of single settings [%], and the ``e_v_ratio`` of both experiments.

    Raises:
        InputError: ``samples`` is no whole number from 1, or the folder holds such a sweep of other settings.
        MissingExtraError: the extra ``sweep`` is not installed.
    """
    from pathcontrol.view.figures.style import save_figure
    from pathcontrol.view.report.sensitivity_section import sensitivity_page

    out = refuse_suffix(out, "a folder", name="out")
    peaks = peaks_of(run_combinations(out / "sensitivity", samples, progress))
    summary, figure = summarise(peaks), sensitivity_figure(peaks)
    save_figure(figure, out / "sensitivity")
    text = sensitivity_page(figure, sentences(summary), *tables(summary))
    write_whole(out / "sensitivity.html", text.encode())
    write_whole(out / "sensitivity.json", (json.dumps(summary, indent=2) + "\n").encode())
    return summary


def sensitivity_figure(peaks: Peaks) -> Figure:
    """Return the peaks of all combinations of each experiment, the paper's too, and their ratios between the two."""
    from pathcontrol.view.figures.cloud import Panel, cloud_figure

    cloud, names = cloud_of(peaks), ("e_p_peak_deg", "e_v_peak_deg_s")
    at = {
        key: [np.array([source[key][name] for name in names]) for source in (cloud, _nominal(peaks), PAPER)]
        for key in _TITLES
    }
    labels = (r"peak of $\|e_p\|$ [deg]", r"peak of $\|e_v\|$ [deg/s]")
    panels = [Panel(title, labels, *at[key]) for key, title in _TITLES.items()]
    ratios = [b / a for a, b in zip(at["extended_motion_plan"], at["projection"], strict=True)]
    panels.append(Panel("projection / plan", (r"ratio of $\|e_p\|$", r"ratio of $\|e_v\|$"), *ratios))
    return cloud_figure(panels, furthest(cloud) <= _BOX, _BOX, ("all four within 10 %", "pathcontrol reproduce"))


def _nominal(peaks: Peaks) -> dict[str, dict[str, float]]:
    return {key: {name: float(values[0]) for name, values in own.items()} for key, own in peaks.items()}


def sentences(summary: dict[str, Any]) -> list[str]:
    """Return sentences that say what the numbers mean."""
    count, ratio = summary["samples"], summary["e_v_ratio"]
    near, far = (summary["fractions"][f"all_four_within_{share}_percent"] for share in (10, 20))
    reached = round(count * ratio["fraction_that_reaches_the_paper"])
    return [
        f"Of {count} combinations of what the paper leaves unsaid, {100 * near:.0f} % keep all four peaks within 10 % "
        f"of the paper's, and {100 * far:.0f} % within 20 %.",
        f"Coulomb friction 10 % lower or higher changes the four peaks by {_range(summary, 'Coulomb', '')}.",
        f"A filter of 20 Hz on the velocity changes them by {_range(summary, 'filter', '20 Hz')}, to as much as "
        f"{_farthest(summary, '20 Hz'):.0f} % from the paper's.",
        f"The paper's peak of ‖e_v‖ is {ratio['paper']:.2f} times as large with the projection as with the extended "
        f"motion plan. Here that ratio is {ratio['nominal']:.2f}, and from {ratio['least']:.2f} to "
        f"{ratio['largest']:.2f} over all combinations; "
        + (f"{reached} of {count} reach the paper's." if reached else "the paper's is not reproduced."),
    ]


def _range(summary: dict[str, Any], setting: str, value: str) -> str:
    """Return the range over which the peaks change by a setting, in words."""
    changes = [
        change
        for effect in summary["effects"]
        if effect["setting"].startswith(setting) and effect["value"].endswith(value)
        for own in effect["change_percent"].values()
        for change in own.values()
    ]
    return f"{_signed(min(changes))} to {_signed(max(changes))} %"


def _farthest(summary: dict[str, Any], value: str) -> float:
    """Return how far the peaks with one setting are from the paper's at most, in per cent of those."""
    [changes] = [effect["change_percent"] for effect in summary["effects"] if effect["value"] == value]
    peaks = {
        key: {peak: own[peak] * (1 + changes[key][peak] / 100) for peak in own}
        for key, own in summary["nominal"].items()
    }
    return 100 * float(furthest(peaks))


def tables(summary: dict[str, Any]) -> tuple[list[list[str]], list[list[str]]]:
    """Return two tables, heads first: the spread of each peak, and what single settings change of it."""
    columns = [(key, peak) for key in _TITLES for peak in _PEAKS]
    spread = [["peak", "paper", "reproduce", "least", "median", "largest", "within 10 %"]]
    for key, peak in columns:
        symbol, unit = _PEAKS[peak]
        own = summary["spread"][key][peak]
        numbers = [PAPER[key][peak], summary["nominal"][key][peak], own["least"], own["median"], own["largest"]]
        share = f"{100 * own['fraction_within_10_percent']:.0f} %"
        spread.append([f"{_TITLES[key]}, {symbol} [{unit}]", *(f"{number:#.3g}" for number in numbers), share])
    effects = [
        ["one setting", "value", *(f"{_TITLES[key].split()[-1]}, {_PEAKS[peak][0]} [%]" for key, peak in columns)]
    ]
    for effect in summary["effects"]:
        changes = (_signed(effect["change_percent"][key][peak]) for key, peak in columns)
        effects.append([effect["setting"], effect["value"], *changes])
    return spread, effects


def _signed(percent: float) -> str:
    """Return a change in per cent with its sign, 0.0 without one."""
    text = f"{percent:+.1f}"
    return "0.0" if float(text) == 0 else text.replace("-", "−")
