"""One style for all figures, and how they are written: SVG and PNG, whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from pathcontrol._files import whole_file

# Okabe and Ito's colours, told apart with any colour vision
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#8A8A8A"

_STYLE: Any = {
    "font.size": 9.0,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "pathcontrol",
    "savefig.dpi": 300,
}


@contextmanager
def style() -> Iterator[None]:
    """Everything drawn inside has the package's look."""
    with mpl.rc_context(_STYLE):
        yield


def save_figure(figure: Figure, path: str | Path) -> list[Path]:
    """Write ``path`` with the suffixes .svg and .png; returns both paths."""
    stem = Path(path)
    stem = stem.with_suffix("") if stem.suffix in (".svg", ".png") else stem
    written = []
    with style():
        for suffix in (".svg", ".png"):
            target = stem.with_name(stem.name + suffix)
            with whole_file(target) as temporary:
                # no date inside, so that the same run gives the same file
                figure.savefig(temporary, metadata={"Date": None} if suffix == ".svg" else None)
            written.append(target)
    return written
