"""Drawings for the tests of the SVG and DXF readers, and what their contours consist of."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
from hypothesis import Phase, settings
from hypothesis import strategies as st

from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.dxf.reader import read_dxf
from pathcontrol.toolpaths.segments.segment import Polyline

U = np.linspace(0.0, 1.0, 9)
TEN = st.lists(st.integers(0, 10**6), min_size=10, max_size=10, unique=True)  # seeds of what one file holds
#: files of many drawings, which would take minutes to shrink: one for each 25 inputs that the profile asks for
TOGETHER = settings(max_examples=max(1, settings.default.max_examples // 25), phases=[Phase.explicit, Phase.generate])
MM_PAGE = 'width="100mm" height="50mm" viewBox="0 0 100 50"'


def svg(body: str, attributes: str = MM_PAGE) -> str:
    """A document whose user unit is 1 mm, unless other attributes are given."""
    spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return f"<svg {spaces} {attributes}>{body}</svg>"


def dxf_reader(folder: Path):
    """Reads what a function puts into a modelspace, in metres unless other units are given."""

    def read(draw, units=6, version="R2010", **options):
        document = ezdxf.new(version, units=units)
        draw(document.modelspace())
        document.saveas(folder / "drawing.dxf")
        return read_dxf(folder / "drawing.dxf", **options)

    return read


def apart(draws):
    """Draws what several functions do, each on a layer of its own: one file for many drawings."""

    def draw(modelspace):
        for k, one in enumerate(draws):
            before = len(modelspace)
            one(modelspace)
            for entity in modelspace[before:]:
                entity.dxf.layer = f"drawing {k}"

    return draw


def write(folder: Path, text: str, name: str = "drawing.svg") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def samples(contour: Contour) -> np.ndarray:
    """Points on every edge and curve of a contour, (pieces, 9, 3)."""
    found = []
    for segment in contour.segments:
        if isinstance(segment, Polyline):
            start, step = segment.points[:-1], np.diff(segment.points, axis=0)
            found += list(start[:, None] + U[:, None] * step[:, None])
        else:
            found.append(segment.point(U))
    return np.array(found)


def upright(x: np.ndarray, height: float = 50.0) -> np.ndarray:
    """Points of an SVG drawing in mm, as complex numbers, in the frame of the workpiece [m]."""
    x = np.asarray(x)
    return np.stack([x.real, height - x.imag, 0 * x.real], axis=-1) * 1e-3


def bezier(points: list[complex]) -> np.ndarray:
    """A Bézier curve by de Casteljau's algorithm at U."""
    rows = [np.full(len(U), p, dtype=complex) for p in points]
    while len(rows) > 1:
        rows = [(1 - U) * a + U * b for a, b in pairwise(rows)]
    return rows[0]
