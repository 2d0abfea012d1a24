"""Kinds of elements of drawings that can be left out, with the same names for SVG and DXF."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pathcontrol.errors import InputError, UnknownNameError

#: names for several kinds at once: tags of SVG and types of DXF, in lower case
KINDS = {
    "text": ("text", "tspan", "flowroot", "mtext", "attrib", "attdef", "rtext", "arcalignedtext"),
    "image": (
        "image",
        "foreignobject",
        "wipeout",
        "oleframe",
        "ole2frame",
        "pdfunderlay",
        "dwfunderlay",
        "dgnunderlay",
    ),
    "point": ("point",),
    "dimension": (
        "dimension",
        "arc_dimension",
        "large_radial_dimension",
        "leader",
        "mleader",
        "multileader",
        "tolerance",
    ),
    "hatch": ("hatch", "mpolygon"),
    "solid": ("solid", "trace", "3dface", "3dsolid", "body", "region", "surface", "mesh"),
}


def names_of(option: str, names: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """Check that an option is a name or several, and return them; None where it is None.

    Raises:
        InputError: it is something else.
    """
    if names is None:
        return None
    found = (names,) if isinstance(names, str) or not isinstance(names, Iterable) else tuple(names)
    wrong = [name for name in found if not isinstance(name, str)]
    if wrong:
        raise InputError(
            f"{option} = {names!r}, expected a name or several, such as ['a', 'b']", argument=option, value=names
        )
    return found


def kinds_to_skip(names: str | Sequence[str] | None, known: Iterable[str]) -> frozenset[str]:
    """Return the kinds, in lower case, that these names stand for.

    Args:
        names: ``"text"`` and the other names of :data:`KINDS`, or single kinds; a string may hold several: ``"a,b"``.
        known: the kinds that there are.

    Raises:
        UnknownNameError: a name stands for none.
        InputError: ``names`` are no names.
    """
    there = {kind.lower() for kind in known}
    single = there | {kind for kinds in KINDS.values() for kind in kinds}
    found: set[str] = set()
    for name in [name.strip() for some in names_of("skip", names) or () for name in some.split(",")]:
        kinds = KINDS.get(name.lower(), (name.lower(),))
        if not single.issuperset(kinds):
            raise UnknownNameError(
                f"skip: {name[:60]!r} is no kind of thing in this drawing, expected some of "
                f"{', '.join(map(repr, KINDS))}, or a type such as {', '.join(map(repr, sorted(there)[:12]))}",
                argument="skip",
                value=name,
            )
        found.update(kinds)
    return frozenset(found)
