"""The figures of runs, as images inside a page."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from pathcontrol.analysis.observing_laws import compensates_observed, halts_at_contacts
from pathcontrol.analysis.power.power_balance_table import find_power_balance
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError, PathControlError
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PIXELS = 96  # CSS pixels in an inch
_LARGEST, _PNG_DPI = 1_000_000, 200  # bytes, dots in an inch
_COMPARED = {"e_p", "e_v", "s", "sdot", "tau"}
_WIDE = 5.0  # inches, from which a figure has a row of its own


class Picture(NamedTuple):
    """A figure: the address of its image, its width [px], whether it is a wide one, and its caption."""

    href: str
    width: int
    wide: bool
    caption: str


def pictures(runs: Mapping[str, Run]) -> list[Picture]:
    """Return the figures of the runs; SVG in images, so that no name in them can be markup of the page.

    Runs of the same joints share figures, others have figures of their own.
    """
    joints = {tuple(run["joint"].to_numpy()) for run in runs.values()}
    if len(joints) == 1:
        return [picture(figure, caption) for caption, figure in _figures(runs)]
    own = {name: _figures({name: run}) for name, run in runs.items()}
    found = [picture(figure, f"{name}: {caption}") for name, figures in own.items() for caption, figure in figures]
    return sorted(found, key=lambda one: one.wide)  # wide ones would end a row of narrow ones


def _figures(runs: Mapping[str, Run]) -> Iterator[tuple[str, Figure]]:
    """Yield figures of runs of the same joints, with their captions."""
    from pathcontrol.view.figures.comparison_figure import comparison_figure
    from pathcontrol.view.figures.deviation_figure import deviation_figure
    from pathcontrol.view.figures.error_figures import error_bands_figure, error_figure
    from pathcontrol.view.figures.limits_figure import largest_shares, limits_figure
    from pathcontrol.view.figures.observer_figure import observer_figure
    from pathcontrol.view.figures.path_figures import path_figure, phase_figure
    from pathcontrol.view.figures.speed_figure import speed_figure
    from pathcontrol.view.figures.tool_figure import tool_figure
    from pathcontrol.view.figures.torque_figure import torque_figure

    one = next(iter(runs.values()))
    shown = runs if len(runs) > 1 else one
    recorded = set.intersection(*(set(run.data.data_vars) for run in runs.values()))
    if len(runs) > 1 and recorded >= _COMPARED:
        yield "Comparison", comparison_figure(runs)
    if one.data.sizes["joint"] > 1:
        yield "Path of the joints", path_figure(shown)
    yield "Path of the tool", tool_figure(shown)
    if {"e_p", "e_v"} <= recorded:
        yield "Errors", error_figure(shown)
        if any(run.rollouts > 1 for run in runs.values()):
            yield "Errors of all rollouts", error_bands_figure(shown)
    if (round_trip := _draw_ballbar(shown)) is not None:
        yield "Radial error round the circle", round_trip
    if {"s", "sdot"} <= recorded:
        yield "Speed along the path", speed_figure(shown)
    if "tau" in recorded:
        yield "Torques", torque_figure(shown)
    if {"q", "qd", "tau"} <= recorded and all(run.model.has_mass for run in runs.values()):
        if any(map(compensates_observed, runs.values())):
            yield "Torques beside those of motors, which the law compensates", observer_figure(shown)
        if any(map(_has_more_to_see, runs.values())):
            yield "Torques beside those of motors and friction", observer_figure(shown, friction="full")
    if (balance := _draw_power_balance(shown)) is not None:
        yield "Lyapunov function, and the causes of its rate", balance
    if any(largest_shares(run) for run in runs.values()):
        yield "Shares of limits", limits_figure(shown)
    if "qd" in recorded:
        yield "Velocities over positions", phase_figure(shown)
    for name, run in runs.items():
        if isinstance(run.task, ToolpathTask) and "path_index" in run.data.coords:
            of = f" of {name}" if len(runs) > 1 else ""
            yield f"Distance of the tool from the drawing{of}", deviation_figure(run, run.robot, run.task)


def _has_more_to_see(run: Run) -> bool:
    """Return whether more may act on the arm than the friction that its law knows, or a law looks out for that."""
    real = table(run.config, "loop").get("loop") in ("log", "hardware")
    return real or bool(table(run.config, "disturbance")) or halts_at_contacts(run) or run.model is not run.robot


def _draw_ballbar(runs: Run | Mapping[str, Run]) -> Figure | None:
    """Return the figure of the radial error, where all runs go round a circle."""
    from pathcontrol.view.figures.ballbar_figure import ballbar_figure

    try:
        return ballbar_figure(runs)
    except (InputError, KeyError):
        return None


def _draw_power_balance(runs: Run | Mapping[str, Run]) -> Figure | None:
    """Return the figure of the power balance, of the runs that have one."""
    from pathcontrol.view.figures.power_balance_figure import power_balance_figure

    try:
        return power_balance_figure(runs)
    except PathControlError:  # one has none
        several = {} if isinstance(runs, Run) else runs
    able = {name: run for name, run in several.items() if find_power_balance(run) is not None}
    return power_balance_figure(able) if able else None


def picture(figure: Figure, caption: str) -> Picture:
    """Return a figure as SVG, or as PNG where the SVG would be too large."""
    width, (kind, drawn) = figure.get_figwidth(), _draw(figure)
    text = base64.b64encode(drawn).decode()
    return Picture(f"data:image/{kind};base64,{text}", round(_PIXELS * width), width > _WIDE, caption)


def _draw(figure: Figure) -> tuple[str, bytes]:
    """Return the kind of image that a figure is drawn as, and its file."""
    from pathcontrol.view.figures.panel_layout import laid_out
    from pathcontrol.view.figures.style import style

    with style(), laid_out(figure, _PNG_DPI):
        svg, png = io.BytesIO(), io.BytesIO()
        figure.savefig(svg, format="svg", dpi=_PNG_DPI, metadata={"Date": None})
        if len(svg.getvalue()) <= _LARGEST:
            return "svg+xml", svg.getvalue()
        figure.savefig(png, format="png", dpi=_PNG_DPI)
        return "png", png.getvalue()
