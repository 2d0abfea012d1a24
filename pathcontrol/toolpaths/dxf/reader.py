"""Reader of DXF drawings.

ezdxf reads the file and places blocks; the curves are worked out here, so that they stay exact under any transform, and
what ezdxf would fill in, such as a missing radius or the unit of a file without header, is asked for, not guessed.
"""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Distance, Feed, Names
from pathcontrol.errors import PathControlError, ToolpathError, UnknownNameError
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.drawing.chains import Strand, chain_strands, checked_gap
from pathcontrol.toolpaths.drawing.duplicates import note_doubled
from pathcontrol.toolpaths.drawing.pieces import Budget
from pathcontrol.toolpaths.drawing.skip import kinds_to_skip, names_of
from pathcontrol.toolpaths.dxf.blocks import Entities
from pathcontrol.toolpaths.dxf.entities import DRAWN, pieces
from pathcontrol.toolpaths.dxf.visible_layers import Layers
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.segments.segment import Segment
from pathcontrol.toolpaths.text import read_text

#: units of length by name [m]
UNITS = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "km": 1e3,
    "in": 0.0254,
    "ft": 0.3048,
    "yd": 0.9144,
    "mil": 2.54e-5,
    "uin": 2.54e-8,
}
_BY_CODE = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 8: "uin", 9: "mil", 10: "yd"}
_BY_CODE |= {12: "nm", 13: "um", 14: "dm"}
_MOST_LINES, _LONGEST_LINE, _MOST_ENTITIES = 5_000_000, 100_000, 500_000


def read_dxf(
    path: str | os.PathLike[str],
    unit: str | None = None,
    layers: Names | None = None,
    feed: Feed | None = None,
    unknown: Literal["refuse", "warn"] = "refuse",
    skip: Names = (),
    gap: Distance | None = None,
) -> Toolpath:
    """Read the contours of a DXF drawing's modelspace, in its order.

    LINE, ARC, CIRCLE, ELLIPSE, LWPOLYLINE, POLYLINE, SPLINE and HELIX are read, and the blocks that INSERT places.
    Splines become exact Bézier curves, bulges arcs; arcs within 1e-4 rad of a whole turn are whole. Loose curves of one
    layer that meet end to end are chained into one contour, in the place and direction of the first of them; where more
    than two meet, chains end. Widths and colours are not looked at. The notes tell what is not seen or not plotted and
    therefore left out, what is dashed, edges drawn twice, and gaps up to 50 µm that stay open.

    Args:
        path: the file.
        unit: unit of its lengths: m, dm, cm, mm, um, nm, km, in, ft, yd, mil or uin; by default the one that the file
            names ($INSUNITS). It is never guessed.
        layers: which layers to read; by default all that are seen and plotted: neither off, frozen, Defpoints, nor
            marked as not to be plotted.
        feed: speed of the tool [m/s] along all contours, or None: DXF has none.
        unknown: ``"refuse"`` what is not understood, or ``"warn"``, pass it over where it cannot change what is cut.
        skip: what to leave out: ``"text"``, ``"image"``, ``"point"``, ``"dimension"``, ``"hatch"``, ``"solid"``, or
            types of DXF such as ``"CIRCLE"``.
        gap: how far apart ends are that meet [m]; by default 1 µm, or 0.01 % of the drawing's diagonal if that is less.

    Raises:
        ToolpathError: the file is no DXF drawing, names no unit, or holds what cannot be cut on the layers read: text,
            hatches, dimensions, solids. The message says which, and on which layers.
        UnknownNameError: there is no such unit, layer or kind.
        InputError: ``feed`` is not greater than 0, ``gap`` is less than 0, ``unknown`` is no choice.
    """
    if feed is not None:
        as_scalar("feed", feed, positive=True)
    gap, names = checked_gap(gap), names_of("layers", layers)
    passed = Notes(unknown)
    text = read_text(path, "a DXF drawing")
    source = os.fspath(path)
    with _readable(source):
        document = _load(source, text)
        unit = _unit(source, unit, document.units if "$INSUNITS" in text else 0)
        found = Layers(document, names, passed)
        left_out = kinds_to_skip(skip, [*DRAWN, *found.types])
        entities = Entities(source, document, found.frozen, passed)
        strands = _strands(entities, found, left_out, np.diag([UNITS[unit]] * 3 + [1.0]), passed)
        contours = [strand.contour(source, feed) for strand in chain_strands(strands, gap, passed)] if strands else []
        if not contours:
            raise ToolpathError(
                f"{source} draws no outline on the layers read; its layers are {found.listed}"
                + "".join(f"; {note}" for note in passed.notes),
                file=source,
            )
        note_doubled(contours, passed)
    return Toolpath(tuple(contours), source, unit, passed.notes)


def _load(source: str, text: str) -> Any:
    """Load the drawing, if it is small enough for ezdxf to read it in bounded time and memory."""
    from ezdxf.filemanagement import read

    lines = text.split("\n")
    entities = sum(line.strip() == "0" for line in lines[::2])  # the first line of a pair is the code of the second
    if len(lines) > _MOST_LINES or entities > _MOST_ENTITIES:
        raise ToolpathError(
            f"{source} has {len(lines)} lines and {entities} entities, expected at most {_MOST_LINES} and "
            f"{_MOST_ENTITIES}; split it into several files",
            value=len(lines),
            limit=_MOST_LINES,
            file=source,
        )
    if max(map(len, lines)) > _LONGEST_LINE:
        raise ToolpathError(
            f"{source} has a line of more than {_LONGEST_LINE} characters; is it a DXF drawing?",
            limit=_LONGEST_LINE,
            file=source,
        )
    return read(io.StringIO(text))


@contextmanager
def _readable(source: str) -> Iterator[None]:
    """Name the file in whatever ezdxf raises on a malformed one, also later, while entities are read."""
    try:
        with np.errstate(all="ignore"):  # a value that is not finite is refused when it is drawn
            yield
    except PathControlError:
        raise
    except Exception as error:
        reason = f"{error}".strip() or type(error).__name__
        if isinstance(error, LookupError):
            reason = f"it has no {reason}"
        raise ToolpathError(
            f"{source} is no DXF drawing that can be read: {reason}; save it again as DXF", file=source
        ) from error


def _unit(source: str, unit: str | None, code: int) -> str:
    """Return the unit's name, from the argument or else the file's $INSUNITS."""
    known = ", ".join(UNITS)
    if unit is not None:
        if unit not in UNITS:
            raise UnknownNameError(
                f"unit = {unit!r}, expected one of {known}", argument="unit", value=unit, choices=tuple(UNITS)
            )
        return unit
    if code not in _BY_CODE:
        reason = f"a unit that is not known ($INSUNITS = {code})" if code else "no unit of length"
        raise ToolpathError(
            f"{source} names {reason}; give it: unit= one of {known}",
            argument="unit",
            value=code,
            choices=tuple(UNITS),
            file=source,
        )
    return _BY_CODE[code]


def _strands(entities: Entities, layers: Layers, skip: frozenset[str], scale: Array, passed: Notes) -> list[Strand]:
    """Return the curves of each entity that has a length [m]."""
    strands: list[Strand] = []
    refused: Counter[tuple[str, str]] = Counter()
    budget = Budget()
    for entity, layer, matrix in entities:
        if entity.dxftype().lower() in skip or not layers.read(layer):
            continue
        with entities.at(entity, layer):
            segments = _segments(entity, scale @ matrix, budget)
        name = f"{layer}: {entity.dxftype()} {entity.dxf.get('handle') or ''}".strip()
        if segments is None and passed.lenient:
            passed.pass_over(entity.dxftype(), f"layer {layer!r}")
        elif segments is None:
            refused[entity.dxftype(), layer] += 1
        elif not segments:
            passed.pass_over("a curve without length", name)
        else:
            if linetype := layers.dashes(entity, layer):
                passed.pass_over(f"a curve of line type {linetype}, which is cut solid,", name, "was found")
            strands.append(Strand(name, layer.lower(), len(strands), segments))
    if refused:
        what = ", ".join(f"{count} {kind} on layer {layer!r}" for (kind, layer), count in refused.most_common(8))
        kinds = ",".join(dict.fromkeys(kind for (kind, _), _ in refused.most_common(8)))
        raise ToolpathError(
            f"{entities.source} holds what cannot be cut: {what}; take it away, leave it out with skip={kinds!r}, pass "
            f"it over with unknown='warn', or choose with layers= from {layers.listed}",
            file=entities.source,
        )
    return strands


def _segments(entity: Any, matrix: Array, budget: Budget) -> list[Segment] | None:
    """Return the segments of an entity [m]; None if it cannot be cut."""
    found = pieces(entity)
    if found is None:
        return None
    budget.take(found)
    return [segment for piece in found for segment in piece.mapped(matrix).segments()]
