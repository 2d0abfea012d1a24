"""The memory of the sizes of texts: each is measured once while a figure is laid out, and once for each file."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.text import Text

_MOST = 5000  # texts
_measure: Any = getattr(Text, "_get_layout", None)  # Matplotlib's own; without it nothing is remembered
_measured: dict[Hashable, Any] = {}


@contextmanager
def remembered_texts() -> Iterator[None]:
    """Measure a text once for all that the same renderer lays out or draws in such a context.

    Matplotlib does it whenever it asks for the box of a text, of each number along an axis five times for one file.
    """
    if _measure is None:
        yield
        return
    Text._get_layout = _remember  # type: ignore[attr-defined]
    try:
        yield
    finally:
        Text._get_layout = _measure  # type: ignore[attr-defined]
        _measured.clear()  # it holds renderers, which hold pictures


def _remember(text: Any, renderer: Any) -> Any:
    """Return lines, sizes and box of a ``text`` around its place."""
    if text.get_wrap() or text.get_transform_rotates_text():  # depends on the place
        return _measure(text, renderer)
    key = (
        renderer,
        text.figure.dpi,
        text.get_text(),
        text.get_fontproperties(),
        text.get_rotation(),
        text.get_rotation_mode(),
        text.get_horizontalalignment(),
        text.get_verticalalignment(),
        text._get_multialignment(),
        text._linespacing,
        text.get_parse_math(),
        text.get_usetex(),
    )
    if (found := _measured.get(key)) is None:
        if len(_measured) >= _MOST:
            _measured.clear()
        found = _measured[key] = _measure(text, renderer)
    return found
