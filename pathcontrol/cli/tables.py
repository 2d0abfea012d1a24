"""The tables that the commands print for a person to read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table
from rich.text import Text

from pathcontrol.analysis.readable import count_words
from pathcontrol.cli.group import printable

if TYPE_CHECKING:
    from pathcontrol.comparison.compare import Comparison
    from pathcontrol.simulation.run import Run

_MOST_ROWS = 50
_BORDER = 3  # letters of a column beside its text: the line and a space on both sides


def peaks_table(summary: dict[str, Any]) -> Table:
    """Return the table of steady-state peaks, beside the paper's."""
    table = Table(title="Steady-state peaks in deg and deg/s: measured here, and in the paper")
    for column in ("experiment", "‖e_p‖", "paper", "", "‖e_v‖", "paper", ""):
        table.add_column(column, justify="left" if column == "experiment" else "right")
    for name in ("extended_motion_plan", "projection"):
        measured, paper = summary[name], summary[name]["paper"]
        row = [name.replace("_", " ")]
        for key in ("e_p_peak_deg", "e_v_peak_deg_s"):
            row += [
                f"{measured[key]:.2f}",
                f"{paper[key]:.1f}",
                f"{100 * (measured[key] / paper[key] - 1):+.1f} %",
            ]
        table.add_row(*row)
    return table


def metric_lines(metrics: dict[str, Any], run: Run) -> list[str]:
    """Return a line for each metric, with a value for each rollout; null, for values not finite, is a dash."""
    from pathcontrol.analysis.limit_shares import RATIOS, is_passed
    from pathcontrol.analysis.readable import readable_number, unit_of

    lines = []
    for name, values in metrics.items():
        unit = unit_of(name, run)
        absent = math.inf if name == "settling_time" else math.nan
        words = (readable_number(absent if value is None else value, unit) for value in values)
        line = f"{name:22} {', '.join(words)}"
        beyond = name in RATIOS and any(value is not None and is_passed(value) for value in values)
        lines.append(red(line) if beyond else line)
    return lines


def remark_lines(run: Run) -> list[str]:
    """Return red lines on what must not be overlooked: limits passed, and an arm that did not get there."""
    from pathcontrol.analysis.run_remarks import remarks

    return [red(printable(sentence)) for sentence in remarks(run)]


def comparison_tables(compared: Comparison, width: int) -> list[Table]:
    """Return the table of a comparison, a row for each measure and a column for each law.

    Where the columns are more than ``width`` letters of a terminal can show, the laws are dealt out to several tables.
    """
    from pathcontrol.comparison.comparison_table import tabulate

    title = Text(printable(f"{compared.scenario.name}: {compared.scenario.sentence}"))
    rows = [[cell.replace("± ", "±") for cell in row] for row in tabulate(compared)]  # a narrow cell breaks before it
    return _deal_columns(rows, 1, width, title)


def _deal_columns(rows: Sequence[Sequence[str]], labels: int, width: int, title: Text | None = None) -> list[Table]:
    """Return rows, heads first, as tables that no ``width`` breaks a word of: each has the first ``labels`` columns.

    The other columns are dealt out to as many tables as that takes. A label that is blank in all rows is left out.
    """
    columns = list(zip(*rows, strict=True))
    names, others = [column for column in columns[:labels] if any(column)], columns[labels:]
    tables: list[list[Sequence[str]]] = []
    room = 0
    for column in others:
        room -= _least_width(column, width) + _BORDER
        if room < 0 or not tables:
            tables.append([*names])
            room = width - 1 - sum(_least_width(each, width) + _BORDER for each in (*names, column))
        tables[-1].append(column)
    return [_make_table(columns, len(names), None if i else title, width) for i, columns in enumerate(tables)]


def _least_width(column: Sequence[str], width: int) -> int:
    """Return the length of the longest word of a column, or the part of ``width`` in which longer ones are folded."""
    return min(max((len(word) for cell in column for word in cell.split()), default=0), width // 3)


def _make_table(columns: Sequence[Sequence[str]], labels: int, title: Text | None, width: int) -> Table:
    """Return a table of columns, heads first, which share what ``width`` leaves beside their longest words."""
    least = [_least_width(column, width) for column in columns]
    spare = max(width - 1 - sum(least) - _BORDER * len(columns), 0) // len(columns)
    table = Table(title=title)
    for i, (column, word) in enumerate(zip(columns, least, strict=True)):
        needed = min(max(map(len, column)), word + spare)
        table.add_column(
            Text(printable(column[0])), justify="left" if i < labels else "right", width=needed, overflow="fold"
        )
    for row in list(zip(*columns, strict=True))[1:]:
        table.add_row(*map(Text, map(printable, row)))
    return table


def red(text: str) -> str:
    """Return ``text`` in red on a terminal."""
    return click.style(text, fg="red")


def contour_tables(run: Run, width: int) -> list[Table]:
    """Return the table of contours of a toolpath, or of laps, as several where ``width`` letters are too few.

    There is none for another run.
    """
    from pathcontrol.analysis.contours import contour_table
    from pathcontrol.analysis.lap_table import lap_table

    heads, *rows = contour_table(run) or lap_table(run) or [[]]
    return _deal_columns([heads, *rows[:_MOST_ROWS]], 2, width) if rows else []


def toolpath_tables(content: dict[str, Any], width: int) -> list[Text | Table]:
    """Return the content of a toolpath from its summary, in millimetres: a line, and a row for each contour."""
    contours = content["contours"]
    size = " × ".join(f"{1e3 * (b - a):.6g}" for a, b in zip(*content["bounds_m"], strict=True))
    cuts, rapids = (f"{1e3 * content[key]:.6g}" for key in ("cut_length_m", "rapid_length_m"))
    head = (
        f"{content['source']}: {count_words(len(contours), 'contour')}, drawn in {content['unit']}: {cuts} mm of cuts "
        f"and {rapids} mm of rapids, within {size} mm"
    )
    heads = ["contour", "", "length [mm]", "feed [mm/s]", "points", "corners", "sharpest [°]"]
    tables = _deal_columns([heads, *map(_contour_row, contours[:_MOST_ROWS])], 2, width)
    left_out = len(contours) - _MOST_ROWS
    return [Text(head), *tables, *([Text(f"and {left_out} more; --json lists them all")] if left_out > 0 else [])]


def _contour_row(contour: dict[str, Any]) -> list[str]:
    """Return the row of a contour."""
    return [
        contour["name"],
        "rapid" if contour["rapid"] else "closed" if contour["closed"] else "open",
        f"{1e3 * contour['length_m']:.6g}",
        "" if contour["feed_m_s"] is None else f"{1e3 * contour['feed_m_s']:.4g}",
        str(contour["points"]),
        str(contour["corners"]),
        f"{contour['sharpest_deg']:.1f}" if contour["corners"] else "",
    ]
