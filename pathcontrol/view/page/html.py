"""The HTML file of a film: Meshcat's viewer, the film and the charts, with nothing to fetch."""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import jinja2
from markupsafe import Markup

from pathcontrol.view.animation.payload import Film

#: the page's script in the order in which it is put together; each part says what it is for
PARTS = (
    "film.js",
    "numbers.js",
    "theme.js",
    "camera.js",
    "scene.js",
    "tracks.js",
    "growing.js",
    "timed.js",
    "thickness.js",
    "labels.js",
    "picture.js",
    "clock.js",
    "loop.js",
    "colors.js",
    "scrubbing.js",
    "tables.js",
    "caption.js",
    "axes.js",
    "ranges.js",
    "charts.js",
    "plane_map.js",
    "plane.js",
    "controls.js",
    "keyboard.js",
    "printing.js",
    "player.js",
)
STYLES = ("vendor/uPlot.min.css", "css/page.css", "css/player.css", "css/charts.css")


class Section(NamedTuple):
    """A section of a page below its player.

    Attributes:
        title: heading; any text, it is never markup.
        body: HTML that is safe: made by a Jinja template with autoescape.
    """

    title: str
    body: Markup


def page(film: Film, title: Sequence[str], sections: Sequence[Section] = ()) -> str:
    """Return the page that plays a film.

    It works from ``file://`` in any browser with WebGL, and its content security policy allows no connection and no
    script but its own.

    Args:
        film: what is to be seen, its charts and its tables.
        title: what to say in the title line; any text, it is never markup.
        sections: what to say below; with three or more there is a table of contents.
    """
    player, (viewer, viewer_digest) = _player(), _viewer()
    text = _template().render(
        policy=_policy([_digest(player), viewer_digest]),
        title=list(title),
        sections=sections,
        styles=Markup("\n".join(own_text(name) for name in STYLES)),
        player=Markup(player),
        viewer=viewer,
        film=film.text(),
    )
    return text.encode(errors="backslashreplace").decode()  # halves of characters cannot be written to a file


def own_text(name: str) -> str:
    """Return the text of a file of the page, by its place beside this module."""
    return resources.files("pathcontrol.view.page").joinpath(*name.split("/")).read_text("utf-8")


@cache
def _template() -> jinja2.Template:
    """Return the template of the page."""
    return jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(own_text("template.html"))


@cache
def _player() -> str:
    """Return the charts' library with its licence, and our own scripts, which share one scope."""
    own = "\n".join(own_text(f"js/{name}") for name in PARTS)
    licence = f"/*! uPlot: {own_text('vendor/LICENSE')}*/"
    return _embed(f'{licence}\n"use strict";\n(() => {{\n{own_text("vendor/uPlot.iife.min.js")}\n{own}\n}})();\n')


@cache
def _viewer() -> tuple[str, str]:
    """Return Meshcat's viewer, zipped and in base64, a quarter of its size, and the digest that permits it."""
    package = find_spec("meshcat")  # found without its code, which would load a server
    assert package is not None
    assert package.origin is not None
    script = Path(package.origin).with_name("viewer").joinpath("dist", "main.min.js").read_text("utf-8")
    zipped = gzip.compress(script.encode(), compresslevel=6, mtime=0)
    return base64.b64encode(zipped).decode(), _digest(script)


def _embed(script: str) -> str:
    """Return a script that may stand between tags; a closing tag can only be inside a string and is escaped."""
    return re.sub(r"<(?=/script|!--)", r"\\x3c", script, flags=re.IGNORECASE)


def _digest(script: str) -> str:
    """Return the digest of a script."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _policy(digests: Sequence[str]) -> str:
    """Return a content security policy: these scripts and no others, and nothing from the network."""
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "worker-src blob:; base-uri 'none'; form-action 'none'"
    )
