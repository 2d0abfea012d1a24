"""The function :func:`report`: one page about one run or several, to keep, to print and to send."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pathcontrol._expect import expect
from pathcontrol._files import whole_file
from pathcontrol._suffixes import check_suffix
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run

if TYPE_CHECKING:
    from pathcontrol.sweeps.result import SweepResult
    from pathcontrol.view.animation.scene.arm_layout import Layout


def report(
    runs: Run | Mapping[str, Run],
    out: str | Path,
    *,
    title: str | None = None,
    layout: Layout = "beside",
    command: str | None = None,
    sweep: SweepResult | None = None,
) -> Path:
    """Write one page with the animation, the metrics, the figures and the configuration of runs; it needs no network.

    Several runs are compared: they move together, a table has a column for each and marks the best of every row, and
    settings that differ are marked. The page also holds the metrics and the configuration as JSON, samples of the
    signals as CSV, and how to make the runs again.

    Args:
        runs: a run, or several by their names.
        out: the file to write, whole or not at all.
        title: heads the page; by default robot, controller and duration.
        layout: several arms ``"beside"`` one another, or ``"ghosted"`` in one place.
        command: what to say made the page, by default this function.
        sweep: what the runs are histories of, :meth:`SweepResult.histories`; its numbers and figures come first.

    Raises:
        InputError: there are no runs, one does not know its robot, or ``out`` does not end with ``.html``.
    """
    from pathcontrol.view.animation.record import record_for_page
    from pathcontrol.view.page.html import page
    from pathcontrol.view.report.sections import sections

    named, out = _name_runs(runs), check_suffix(out, "a report as a page", ".html", ".htm", name="out")
    animation = record_for_page(runs, layout=layout)
    words = animation.title if title is None else (title,)
    text = page(animation.film, words, sections(named, command or _call(named, out), sweep))
    with whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out


def _name_runs(runs: Any) -> dict[str, Run]:
    """Return the runs by name."""
    if isinstance(runs, Run):
        return {"run": runs}
    if not isinstance(runs, Mapping) or not runs or not all(isinstance(run, Run) for run in runs.values()):
        expect("runs", runs, Run, Mapping, also=" or several by name, as {'first': run}")
        raise InputError(
            f"runs = {runs!r}, expected a Run or several by name, as {{'first': run}}", argument="runs", value=runs
        )
    return {str(name): run for name, run in runs.items()}


def _call(runs: Mapping[str, Run], out: Path) -> str:
    """Return the Python call that made the page."""
    names = "run" if list(runs) == ["run"] else "{" + ", ".join(f"{name!r}: …" for name in runs) + "}"
    return f"pathcontrol.report({names}, {out.name!r})"
