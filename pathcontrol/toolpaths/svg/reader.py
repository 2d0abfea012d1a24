"""Reader of SVG drawings.

lxml parses the document; what its elements draw is worked out here, by the specification. Libraries were tried:
svgelements 1.9.6 places nested svg elements wrongly, draws symbols, masks and markers that only define, takes an inch
for 25.39999 mm, cuts malformed path data off without a word and recurses on a use element inside itself until Python
stops it; svgpathtools 1.8.0 and svg.path 7.1 read path data, but know no units, styles or use elements, and forgive
or lose part of what they read. A contour that is silently another one is a scrapped part.
"""

from __future__ import annotations

import os
from typing import Annotated, Literal

from pathcontrol._arrays import as_scalar
from pathcontrol.arguments import Distance, Feed, Form, Names
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.drawing.chains import chain_strands, checked_gap
from pathcontrol.toolpaths.drawing.duplicates import note_doubled
from pathcontrol.toolpaths.drawing.skip import kinds_to_skip, names_of
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.svg.document import Document, tag_of
from pathcontrol.toolpaths.svg.layers import Chosen
from pathcontrol.toolpaths.svg.shapes import SHAPES
from pathcontrol.toolpaths.svg.viewport import page_unit
from pathcontrol.toolpaths.svg.walk import Walk


def read_svg(
    path: str | os.PathLike[str],
    ppi: Annotated[float, Form.POSITIVE] = 96.0,
    feed: Feed | None = None,
    unknown: Literal["refuse", "warn"] = "refuse",
    layers: Names | None = None,
    skip: Names = (),
    gap: Distance | None = None,
) -> Toolpath:
    """Read the outlines that an SVG file draws, in its order: a contour for each subpath, named after the id.

    Lengths are those on the page, by its width and height (mm, cm, in, pt, pc, Q, px) and its viewBox. The drawing
    stands upright, x to the right and y up from the page's lower left corner, z = 0. Everything that is seen is cut,
    be it stroke or fill, of whatever colour, and also beyond the edges of the page. What is hidden, only defined, or
    painted with neither fill nor stroke, is not; the notes say so. Dashed strokes are cut solid, and noted.
    Bézier curves and elliptic arcs stay what they are.

    Args:
        path: the file.
        ppi: pixels per inch, 96 by CSS; some programs write 72 or 90.
        feed: speed of the tool [m/s] along all contours, or None: SVG has none.
        unknown: ``"refuse"`` what is not understood, or ``"warn"``, pass it over where it cannot change what is cut.
        layers: labels of layers, or ids of groups or shapes, outside of which nothing is read; one that is asked for is
            read even if it is hidden. By default everything is read.
        skip: what to leave out: ``"text"``, ``"image"``, or tags of SVG.
        gap: join contours of a layer whose ends lie so near to each other [m]; by default none are joined.

    Raises:
        ToolpathError: the file is no SVG, defines entities, or holds what is not understood or cannot be cut: text,
            images, clip paths that cut something off, malformed attributes. The message says in which line and element.
        UnknownNameError: there is no such layer or kind.
        InputError: ``ppi`` or ``feed`` is not greater than 0, ``gap`` is less than 0, ``unknown`` is no choice.
    """
    as_scalar("ppi", ppi, positive=True)
    if feed is not None:
        as_scalar("feed", feed, positive=True)
    gap = checked_gap(gap)
    passed, names = Notes(unknown), names_of("layers", layers)
    document = Document(path)
    tags = {tag for element in document.root.iter("*") if (tag := tag_of(element))} if skip else set()
    walk = Walk(document, Chosen(document, names), kinds_to_skip(skip, tags | SHAPES), passed)
    strands = list(walk.strands(ppi))
    if not strands:
        raise ToolpathError(
            f"{document.path} draws no outline; expected paths or shapes that are seen"
            + "".join(f"; {note}" for note in passed.notes),
            file=str(document.path),
        )
    contours = [
        s.contour(document.path, feed) for s in (strands if gap is None else chain_strands(strands, gap, passed))
    ]
    note_doubled(contours, passed)
    unit = page_unit(document.attributes(document.root))
    return Toolpath(tuple(contours), document.path, unit, passed.notes)
