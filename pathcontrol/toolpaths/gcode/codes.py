"""The G and M codes that are understood, and why others are not."""

from __future__ import annotations

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.words import Block

#: modal groups: of each, a line has at most one code; numbers times ten
GROUPS = {
    "motion": {0: "G0", 10: "G1", 20: "G2", 30: "G3"},
    "end of motion": {800: "G80"},
    "plane": {170: "G17", 180: "G18", 190: "G19"},
    "distance": {900: "G90", 910: "G91"},
    "arc centre": {901: "G90.1", 911: "G91.1"},
    "unit": {200: "G20", 210: "G21"},
    "elsewhere": {40: "G4", 280: "G28", 300: "G30", 530: "G53"},
    "feed mode": {940: "G94"},
    "tool radius": {400: "G40"},
    "tool length": {430: "G43", 490: "G49"},
    "coordinate system": {540: "G54"},
    "path control": {610: "G61", 611: "G61.1", 640: "G64"},
    "spindle mode": {970: "G97"},
}
_GROUP_OF = {code: group for group, codes in GROUPS.items() for code in codes}

#: codes that end a program, and those that move nothing
PROGRAM_END = {2, 30}
_M_CODES = PROGRAM_END | {0, 1, 3, 4, 5, 6, 7, 8, 9}

_SUPPORTED = (
    "supported are G0-G3, G4, G17-G19, G20, G21, G28, G30, G40, G43, G49, G53, G54, G61, G64, G80, G90, G91, G90.1, "
    "G91.1, G94, G97, M0-M9 and M30"
)
_RADIUS = "the path depends on a radius that is not in the file: let the CAM program compensate for it"
_OFFSET = "the coordinates depend on an offset that is not in the file: refer the program to one origin, G54"
_CYCLE = "canned cycles are not supported: let the CAM program write every move"
_FEED = "only feed per minute, G94, is supported"
_REASONS = {
    **dict.fromkeys((410, 411, 420, 421), _RADIUS),
    **dict.fromkeys((100, 431, 432, 520, *range(550, 600), *range(920, 924)), _OFFSET),
    **dict.fromkeys((730, 740, 760, *range(810, 900)), _CYCLE),
    **dict.fromkeys((930, 950), _FEED),
    **dict.fromkeys((50, 51, 52, 53), "splines are not supported: let the CAM program write lines and arcs"),
    **dict.fromkeys((500, 510, 511, 680, 690), "scaling and rotation are not supported: let the CAM program do them"),
    650: "macros are not supported: let the CAM program write every move",
}
_LETTERS = {
    **dict.fromkeys("ABCUVW", "only the axes X, Y and Z are supported"),
    **dict.fromkeys("IJKR", "it belongs to an arc, G2 or G3"),
    **dict.fromkeys("XYZ", "there is no motion that it belongs to: write G0, G1, G2 or G3"),
    **dict.fromkeys("PQ", "it belongs to G4 or G64"),
    "D": _RADIUS,
    "E": "extruders are not supported",
    "H": "it belongs to G43",
    "L": "repetitions are not supported",
    "O": "subprograms are not supported, and a program number stands alone at the beginning",
}


def groups(block: Block) -> dict[str, int]:
    """The code of each modal group in the block.

    Raises:
        ToolpathError: a code that is not supported, or two of one group.
    """
    found: dict[str, int] = {}
    for code in block.g:
        group = _GROUP_OF.get(code)
        if group is None:
            reason = _REASONS.get(code, _SUPPORTED)
            raise ToolpathError(f"G{code / 10:g} is not understood: {reason}")
        if group in found:
            names = GROUPS[group]
            raise ToolpathError(f"{names[found[group]]} and {names[code]} exclude each other in one line")
        found[group] = code
    for code in block.m:
        if code not in _M_CODES:
            reason = "subprograms are not supported" if code in (97, 98, 99) else _SUPPORTED
            raise ToolpathError(f"M{code} is not understood: {reason}")
    return found


def check_letters(block: Block, allowed: str) -> None:
    """Raise if the block has a word that nothing in it uses; F, S and T stand anywhere."""
    for letter in block.words:
        if letter not in "FST" and letter not in allowed:
            reason = _LETTERS.get(letter, _SUPPORTED)
            raise ToolpathError(f"{letter}{block.words[letter]:g} is not understood here: {reason}")
