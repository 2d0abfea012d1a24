"""The page of a comparison: the arms beside each other with the event marked, the table, and the figure."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from markupsafe import Markup

from pathcontrol._expect import expect
from pathcontrol._files import whole_file
from pathcontrol._suffixes import check_suffix
from pathcontrol.comparison.compare import Comparison
from pathcontrol.comparison.comparison_table import describe_comparison, law_title, tabulate
from pathcontrol.view.animation.record import record_for_page
from pathcontrol.view.figures.scenario_figure import scenario_figure
from pathcontrol.view.page.html import Section, page
from pathcontrol.view.report.pictures import picture
from pathcontrol.view.report.sections import templates


def save_comparison(compared: Comparison, out: str | Path, rollout: int = 0) -> Path:
    """Write one page of a comparison, whole or not at all: it plays in any browser and needs no network.

    The arms of all laws move beside each other, the slider and the charts mark the event, and below are the table and
    the figure.

    Args:
        compared: what :func:`compare` gives.
        out: the file to write.
        rollout: which rollout is shown.

    Raises:
        InputError: ``compared`` is no comparison, there is no such rollout, or ``out`` does not end with ``.html``.
    """
    expect("compared", compared, Comparison)
    out = check_suffix(out, "a comparison as a page", ".html", ".htm", name="out")
    scenario = compared.scenario
    runs = {law_title(law): run for law, run in compared.runs.items()}
    film = record_for_page(runs, rollout=rollout).film
    events = [] if scenario.event is None else [[scenario.event[0], min(scenario.event[1], scenario.duration)]]
    film = dataclasses.replace(film, header=film.header | {"events": events})
    text = page(film, (scenario.name, scenario.sentence), [Section("Comparison", _body(compared, rollout))])
    with whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out


def _body(compared: Comparison, rollout: int) -> Markup:
    """Return the table, its sentences and the figure."""
    template = templates().get_template("comparison.html")
    shown = picture(scenario_figure(compared, rollout, wide=True), f"Rollout {rollout} of each law")
    return Markup(template.render(table=tabulate(compared), sentences=describe_comparison(compared), pictures=[shown]))
