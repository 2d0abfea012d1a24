"""An animation that can be shown: as a page, as a file, in a browser or in a notebook."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from dataclasses import dataclass
from pathlib import Path

from pathcontrol._files import whole_file
from pathcontrol._suffixes import check_suffix
from pathcontrol.view.animation.payload import Film

_NOTEBOOK_HEIGHT = 640  # px


@dataclass(frozen=True, eq=False)
class Animation:
    """A scene that moves; made by :func:`record`.

    Attributes:
        film: all that the page shows; see :class:`pathcontrol.view.animation.payload.Film`.
    """

    film: Film

    def __repr__(self) -> str:
        return f"Animation({', '.join(self.title)})"

    @property
    def title(self) -> tuple[str, ...]:
        """The robot, the controllers and the duration, in words."""
        return tuple(self.film.header["title"])

    @property
    def duration(self) -> float:
        """The duration [s]."""
        return float(self.film.header["duration"])

    def html(self) -> str:
        """Return the page: it plays from ``file://`` and needs no network."""
        from pathcontrol.view.page.html import page

        return page(self.film, self.title)

    def save(self, path: str | Path) -> Path:
        """Write the page, whole or not at all.

        Raises:
            InputError: the name does not end with ``.html``; the message names what writes other formats.
        """
        path = check_suffix(path, "an animation as a page", ".html", ".htm")
        with whole_file(path) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")
        return path

    def open(self) -> Path:
        """Show the page in the default browser, from a file in a new temporary folder; return that file."""
        path = self.save(Path(tempfile.mkdtemp(prefix="pathcontrol-")) / "animation.html")
        webbrowser.open(path.as_uri())
        return path

    def _repr_html_(self) -> str:
        """Return the page for a notebook, in a frame of its own."""
        return (
            f'<iframe srcdoc="{html.escape(self.html())}" title="{html.escape(" - ".join(self.title))}" '
            f'style="width: 100%; height: {_NOTEBOOK_HEIGHT}px; border: 0"></iframe>'
        )
