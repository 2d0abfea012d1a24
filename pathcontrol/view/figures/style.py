"""One style for all figures, written as SVG, PNG and PDF, whole or not at all."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from pathcontrol._expect import expect
from pathcontrol._files import whole_file
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.errors import InputError
from pathcontrol.view.figures.panel_layout import SettledLayout, laid_out
from pathcontrol.view.figures.ticks import SpacedLocator, label_plainly

# Okabe and Ito's colours, told apart with any colour vision; their yellow is too pale on white
BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
#: of the first run, the second, …
RUN_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY)
#: the look of references of a run: the desired path, limits, peaks, ϑ
GREY, INK = "#9A9A9A", "#2B2B2B"
VECTORS = 5000  # points from which they are an image inside an SVG
DASHED = (0, (4, 2))

#: the look of everything that is not a run
Look = dict[str, Any]
DESIRED_LOOK: Look = {"color": GREY, "linewidth": 2.4, "zorder": 1.9}
START_LOOK: Look = {"marker": "o", "markerfacecolor": "white", "markersize": 4.5, "zorder": 3}
BEYOND = "#C0392B"  # a limit that must not be passed
LIMIT_LOOK: Look = {"color": INK, "linewidth": 0.9}
PROFILE_LOOK: Look = {"color": INK, "linewidth": 0.8, "linestyle": DASHED}
PEAK_LOOK: Look = {"linewidth": 0.8, "linestyle": DASHED}

#: widths of figures [in]: one column of a page with two, and both
COLUMN, PAGE = 3.5, 7.2
FORMATS = ("svg", "png", "pdf")
_SUFFIXES = (".svg", ".png", ".pdf")
SMALL = 7.0  # pt, of numbers on axes and in insets
_NOTEBOOK_DPI = 144

_STYLE: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 8.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "lines.linewidth": 1.1,
    "lines.solid_joinstyle": "round",
    "legend.frameon": False,
    "agg.path.chunksize": 20_000,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "pathcontrol",
    "pdf.fonttype": 42,  # TrueType, which journals ask for
    "savefig.dpi": 300,
}
# no dates inside, so that the same run gives the same file
_METADATA: dict[str, Any] = {"svg": {"Date": None}, "png": None, "pdf": {"CreationDate": None}}


@contextmanager
def style() -> Iterator[None]:
    """Draw everything inside with the package's look, independent of the user's settings of Matplotlib."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


class NotebookFigure(Figure):
    """A figure that Jupyter shows without pyplot or a backend."""

    def _repr_png_(self) -> bytes:
        """Return the picture, as in the file of :func:`save_figure` but with fewer dots.

        A copy is drawn, since the layout of what was drawn before differs in its last digits.
        """
        picture, copy = BytesIO(), pickle.loads(pickle.dumps(self))
        with style(), laid_out(copy, _NOTEBOOK_DPI):
            copy.savefig(picture, format="png", dpi=_NOTEBOOK_DPI)
        return picture.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [in]."""
    figure = NotebookFigure(figsize=(width, height), layout=SettledLayout())
    FigureCanvasAgg(figure)  # so that words are measured once, for the layout and for PNG
    return figure


def apply_style(axes: Axes) -> Axes:
    """Return ``axes`` with grid and ticks in the style, set here, as ticks are made when they are first drawn."""
    axes.grid(True, color="#E3E3E3", linewidth=0.6)
    axes.tick_params(labelsize=SMALL, width=0.7, length=2.5, pad=2.5)
    axes.tick_params(which="minor", labelsize=SMALL, width=0.5, length=1.5, pad=3.5)
    for axis in (axes.xaxis, axes.yaxis):
        axis.get_offset_text().set_fontsize(SMALL)
        label_plainly(axis)
    axes.xaxis.set_major_locator(SpacedLocator(SMALL))
    return axes


def error_colours() -> LinearSegmentedColormap:
    """Return a colour map for errors: evenly perceived, without the yellow that is lost on white."""
    shades = mpl.colormaps["plasma"]
    return LinearSegmentedColormap.from_list("errors", [shades(0.88 * i / 15) for i in range(16)])


def save_figure(figure: Figure, path: str | Path, formats: Sequence[str] = ("svg", "png")) -> list[Path]:
    """Write a figure in several formats, all of them or none.

    The same run gives the same bytes. Text stays text in SVG and PDF; PNG has 300 dpi.

    Args:
        figure: what to write.
        path: where, without a suffix. A suffix ``.svg``, ``.png`` or ``.pdf`` asks for that format besides.
        formats: which of ``"svg"``, ``"png"`` and ``"pdf"``.

    Returns:
        The files, in the order of the formats.

    Raises:
        InputError: a format is not known, the name promises another one, or a file cannot be written there.
    """
    expect("figure", figure, Figure)
    stem, wanted = refuse_suffix(path, "a figure", *_SUFFIXES), [formats] if isinstance(formats, str) else list(formats)
    if (last := stem.suffix[1:].lower()) in FORMATS:
        stem, wanted = stem.with_suffix(""), [*wanted, last]
    if unknown := [name for name in wanted if name not in FORMATS]:
        raise InputError(
            f"formats has {unknown[0]!r}, expected some of {', '.join(map(repr, FORMATS))}",
            argument="formats",
            value=unknown[0],
            choices=tuple(FORMATS),
        )
    targets = {name: stem.with_name(f"{stem.name}.{name}") for name in wanted}
    with style(), laid_out(figure, mpl.rcParams["savefig.dpi"]), ExitStack() as files:
        for name, target in targets.items():
            figure.savefig(files.enter_context(whole_file(target)), format=name, metadata=_METADATA[name])
    return list(targets.values())


def stem_of(path: str | Path) -> Path:
    """Return ``path`` without the suffix of a format."""
    path = Path(path)
    return path.with_suffix("") if path.suffix.lower() in _SUFFIXES else path
