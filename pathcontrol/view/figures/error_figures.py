"""The figures of error norms over time: lines of single runs, and bands of many rollouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pathcontrol._arrays import Array
from pathcontrol.view.figures.inset import add_inset, later
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import extent, from_zero, over_time
from pathcontrol.view.figures.lines import select_by_column, series
from pathcontrol.view.figures.shown import Runs, Shown, cutting, readable, shown
from pathcontrol.view.figures.style import COLUMN, INK, PEAK_LOOK, SMALL, apply_style, new_figure, style

_MOST_PEAKS = 3
_BANDS = ((0.0, 1.0, 0.15), (0.05, 0.95, 0.3))  # lower and upper quantile, and opacity


def error_figure(run: Runs, rollout: int = 0) -> Figure:
    """Draw ‖e_p‖ [deg] and ‖e_v‖ [deg/s] over time, as in the paper's figures 8 and 10, with their late peaks.

    The inset magnifies the second half, of which the peaks are; those of a toolpath are of its cuts, as in ``metrics``.

    Args:
        run: a run, or several by their names.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such rollout.
    """
    return _norms_figure(shown(run, rollout=rollout), _draw_line, {})


def error_bands_figure(run: Runs) -> Figure:
    """Draw the bands in which ‖e_p‖ [deg] and ‖e_v‖ [deg/s] of many rollouts lie over time.

    The median, the band from the 5th to the 95th percentile, and that from the least to the largest, at each moment.
    Rollouts whose error is no number are left out there.

    Args:
        run: a run of many rollouts, or several by their names.
    """
    runs = shown(run)
    colour = runs[0].colour if len(runs) == 1 else INK
    bands: dict[str, Artist] = {
        "median": Line2D([], [], color=colour),
        "5–95 %": Patch(color=colour, alpha=0.4, linewidth=0),
        "extremes": Patch(color=colour, alpha=0.15, linewidth=0),
    }
    return _norms_figure(runs, _draw_bands, bands)


def draw_norm(axes: Axes, one: Shown, name: str) -> Array:
    """Draw ‖e_p‖ or ‖e_v‖ of the first rollout; return the values drawn (1, k)."""
    values, _ = norms(one, name)
    _draw_line(axes, one, values)
    return values[:1]


def norms(one: Shown, name: str) -> tuple[Array, str]:
    """Return the norm of a vector over the joints (rollout, time), in the unit a person reads, and that unit."""
    vectors, unit = readable(one.run, name)
    return np.linalg.norm(vectors, axis=-1), unit


def norm_label(name: str, unit: str) -> str:
    """Return the label ‖e_p‖ with its unit."""
    letter, index = name.split("_")
    return rf"$\|\mathbf{{{letter}}}_{index}\|$ [{unit}]"


def quantiles(values: Array, levels: Sequence[float]) -> list[Array]:
    """Return quantiles over the rollouts of (rollout, time), each (time,), of finite values; NaN without any."""
    ranked = np.sort(values, axis=0)  # NaN come last
    last = (~np.isnan(values)).sum(0) - 1
    found = []
    for level in levels:
        place = np.maximum(level * last, 0.0)
        low, high = (np.take_along_axis(ranked, f(place).astype(int)[None], 0)[0] for f in (np.floor, np.ceil))
        found.append(low + (place % 1.0) * (high - low))
    return found


_Draw = Callable[[Axes, Shown, Array], None]


def _norms_figure(runs: Sequence[Shown], draw: _Draw, more: Mapping[str, Artist]) -> Figure:
    """Draw both norms, one panel over the other."""
    several = len(runs) > 1 or bool(more)
    with style():
        figure = new_figure(COLUMN, 4.3 if several else 4.1)
        panels = figure.subplots(2, 1, sharex=True)
        for axes, name in zip(panels, ("e_p", "e_v"), strict=True):
            _draw_norms(apply_style(axes), runs, name, draw)
        panels[-1].set_xlabel("time [s]")
        over_time(panels[-1], [one.run.time for one in runs])
        figure.align_ylabels()
        names: dict[str, Artist] = {one.label: Line2D([], [], **one.look) for one in runs if one.name}
        legend(figure, {**names, **more})
    return figure


def _draw_norms(axes: Axes, runs: Sequence[Shown], name: str, draw: _Draw) -> None:
    """Draw one norm over the whole time, and an inset of the second half, with its peaks."""
    found = [norms(one, name) for one in runs]
    values, times, unit = [v for v, _ in found], [one.run.time for one in runs], found[0][1]

    def draw_all(where: Axes) -> None:
        for one, v in zip(runs, values, strict=True):
            draw(where, one, v)

    draw_all(axes)
    axes.set_ylabel(norm_label(name, unit))
    from_zero(axes, values)
    cut = [None if (cuts := cutting(one)).all() else cuts for one in runs]
    peaks = [extent([v[:, later(t) if c is None else c]])[1] for v, t, c in zip(values, times, cut, strict=True)]
    inset = add_inset(axes, times, values, draw_all) if all(c is None for c in cut) else None
    late = "second-half peak" if inset is None else "peak"
    words = [late if c is None else "peak of the cuts" for c in cut]
    _label_peaks(axes if inset is None else inset, runs, peaks, unit, words)


def _label_peaks(axes: Axes, runs: Sequence[Shown], peaks: Sequence[float], unit: str, words: Sequence[str]) -> None:
    """Draw a dashed line at each peak, with its number above the panel after the word for what it is the peak of."""
    colours = [INK] if len(runs) == 1 else [one.colour for one in runs]
    lines = [
        axes.axhline(peak, color=colour, **PEAK_LOOK) for peak, colour in zip(peaks, colours, strict=True) if peak > 0
    ]
    if not lines or len(lines) > _MOST_PEAKS:
        return
    numbers = [(word, f"{peak:.3g}") for peak, word in zip(peaks, words, strict=True) if peak > 0]
    told = ["", *(word for word, _ in numbers)]
    axes.legend(
        lines,
        [
            f"{word} " * (word != told[k]) + number + f" {unit}" * (k == len(lines) - 1)
            for k, (word, number) in enumerate(numbers)
        ],
        loc="lower right",
        bbox_to_anchor=(1.0, 0.97),
        ncols=len(lines),
        fontsize=SMALL,
        handlelength=1.2,
        handletextpad=0.4,
        columnspacing=0.7,
        borderpad=0.0,
    )


def _draw_line(axes: Axes, one: Shown, values: Array) -> None:
    """Draw the norm of a single run."""
    series(axes, one.run.time, values[0], **one.look)


def _draw_bands(axes: Axes, one: Shown, values: Array) -> None:
    """Draw the bands of many rollouts."""
    time, levels = one.run.time, [level for low, high, _ in _BANDS for level in (low, high)]
    *edges, median = quantiles(values, [*levels, 0.5])
    for (_, _, alpha), low, high in zip(_BANDS, edges[::2], edges[1::2], strict=True):
        kept = np.union1d(select_by_column(low), select_by_column(high))
        axes.fill_between(time[kept], low[kept], high[kept], color=one.colour, alpha=alpha, linewidth=0)
    series(axes, time, median, **one.look)
