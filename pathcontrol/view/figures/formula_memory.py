"""The memory of formulas: those of labels are parsed once for all figures, and not again for every file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import get_ident
from typing import Any

from matplotlib.mathtext import MathTextParser

_MOST = 500  # formulas, in their fonts and sizes
_parse: Any = getattr(MathTextParser, "_parse_cached", None)  # Matplotlib's own; without it nothing is remembered
_parsed: dict[Any, Any] = {}


@contextmanager
def remembered_formulas() -> Iterator[None]:
    """Parse a formula once for all pictures that are laid out or drawn in such contexts, which have one style.

    Matplotlib's own memory tells parsers apart, of which each file has its own, so that it helps within a file only.
    """
    if _parse is None:
        yield
        return
    MathTextParser._parse_cached = _remember  # type: ignore[attr-defined]
    try:
        yield
    finally:
        MathTextParser._parse_cached = _parse  # type: ignore[attr-defined]


def _remember(parser: Any, *how: Any) -> Any:
    """Return a formula as a ``parser`` parses it, for this thread, as its letters hold fonts that are for one only."""
    key = (get_ident(), *vars(parser).items(), *how)
    if key not in _parsed:
        if len(_parsed) >= _MOST:
            _parsed.clear()
        _parsed[key] = _parse(parser, *how)
    return _parsed[key]
