"""The page "How sure is this?", in one file without a script."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import jinja2
from markupsafe import Markup

from pathcontrol.view.page.html import own_text
from pathcontrol.view.report.pictures import picture
from pathcontrol.view.report.sections import templates

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Table = Sequence[Sequence[str]]


def sensitivity_page(figure: Figure, sentences: Sequence[str], spread: Table, effects: Table) -> str:
    """Return the page of a figure, its sentences, and two tables, heads first."""
    template: jinja2.Template = templates().get_template("sensitivity.html")
    return template.render(
        styles=Markup(own_text("css/page.css")),
        picture=picture(figure, "Blue: combinations that keep all four peaks within 10 % of the paper's"),
        sentences=sentences,
        spread=spread,
        effects=effects,
    )
