"""Notes on what a reader of toolpaths passes over: each kind is refused, or noted once."""

from __future__ import annotations

from dataclasses import dataclass, field

from pathcontrol.errors import InputError, ToolpathError

#: the choices for words that a reader does not understand and that cannot move the tool
UNKNOWN = ("refuse", "warn")
_MOST_KINDS, _MOST_PLACES = 50, 8


@dataclass
class _Kind:
    """The count of a kind of thing that was passed over, and its first places."""

    count: int = 0
    places: list[str] = field(default_factory=list)


class Notes:
    """A collector of notes on what a reader passes over or assumes, for :attr:`Toolpath.notes`.

    Args:
        unknown: ``"refuse"``, what is not understood is an error; ``"warn"``, it is passed over and noted.

    Raises:
        InputError: ``unknown`` is neither.
    """

    def __init__(self, unknown: str = "refuse") -> None:
        if unknown not in UNKNOWN:
            raise InputError(
                f"unknown = {unknown!r}, expected one of {', '.join(map(repr, UNKNOWN))}",
                argument="unknown",
                value=unknown,
                choices=tuple(UNKNOWN),
            )
        self.lenient = unknown == "warn"
        self._kinds: dict[tuple[str, str], _Kind] = {}
        self._sentences: dict[str, None] = {}

    def pass_over(self, kind: str, place: int | str, fate: str = "was passed over") -> None:
        """Count a thing of a kind that was passed over in a line, given by its number, or at another place.

        Where something else became of it than being passed over, ``fate`` says so.
        """
        found = self._kinds.setdefault((kind, fate), _Kind())
        found.count += 1
        text = str(place)
        if len(found.places) <= _MOST_PLACES and text not in found.places:
            found.places.append(text)

    def unless_refused(self, kind: str, place: int | str, reason: str) -> None:
        """Pass over a thing that is not understood, unless the caller refuses it.

        Use it only for what cannot move the tool.

        Raises:
            ToolpathError: it is to be refused; the message is ``reason`` with the way to pass it over.
        """
        if not self.lenient:
            raise ToolpathError(f"{reason}, or pass it over with unknown='warn'")
        self.pass_over(kind, place)

    def add(self, sentence: str) -> None:
        """Add another sentence to the notes, once."""
        self._sentences[sentence] = None

    @property
    def notes(self) -> tuple[str, ...]:
        """The sentences of the notes: those added as such, then one for each kind, with its count and places."""
        kinds = list(self._kinds.items())
        more = [f"{len(kinds) - _MOST_KINDS} more kinds were passed over"] if len(kinds) > _MOST_KINDS else []
        return (*self._sentences, *(_sentence(*names, kind) for names, kind in kinds[:_MOST_KINDS]), *more)


def _sentence(name: str, fate: str, kind: _Kind) -> str:
    """Write the note on a kind: ``"M62 was passed over 2 times: lines 3, 5"``."""
    times = "once" if kind.count == 1 else f"{kind.count} times"
    lines = "line " if len(kind.places) == 1 else "lines "
    shown = ", ".join(kind.places[:_MOST_PLACES]) + (", …" if len(kind.places) > _MOST_PLACES else "")
    return f"{name} {fate} {times}: {lines if kind.places[0].isdigit() else ''}{shown}"
