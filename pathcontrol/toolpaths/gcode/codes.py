"""The G and M codes that are understood, and the reasons why others are not."""

from __future__ import annotations

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.words import Block

#: modal groups: of each, a line has at most one code; numbers times ten
GROUPS = {
    "motion": {0: "G0", 10: "G1", 20: "G2", 30: "G3", 730: "G73", 810: "G81", 820: "G82", 830: "G83"},
    "end of motion": {800: "G80"},
    "plane": {170: "G17", 180: "G18", 190: "G19"},
    "distance": {900: "G90", 910: "G91"},
    "arc centre": {901: "G90.1", 911: "G91.1"},
    "unit": {200: "G20", 210: "G21"},
    "elsewhere": {40: "G4", 280: "G28", 300: "G30", 530: "G53", 920: "G92", 921: "G92.1"},
    "feed mode": {940: "G94"},
    "tool radius": {400: "G40"},
    "tool length": {430: "G43", 490: "G49"},
    "coordinate system": {
        **{10 * number: f"G{number}" for number in range(54, 60)},
        **{590 + tenth: f"G59.{tenth}" for tenth in (1, 2, 3)},
    },
    "path control": {610: "G61", 611: "G61.1", 640: "G64"},
    "spindle mode": {970: "G97"},
    "return level": {980: "G98", 990: "G99"},
    "scaling": {690: "G69"},
    "polar": {150: "G15"},
    "macro": {670: "G67"},
}
_GROUP_OF = {code: group for group, codes in GROUPS.items() for code in codes}
KNOWN_G = frozenset(_GROUP_OF)

#: codes that end a program, and those that move nothing
PROGRAM_END = {2, 30}
KNOWN_M = frozenset(PROGRAM_END | {0, 1, 3, 4, 5, 6, 7, 8, 9})

_POST = "it may move the tool: let the CAM program write for LinuxCNC or grbl, which need no such code"
_RADIUS = "the path depends on a radius that is not in the file: let the CAM program compensate for it"
_OFFSET = "the coordinates depend on an offset that is not in the file: refer the program to one origin, G54"
_CYCLE = "of the canned cycles only G73 and G81 to G83 are supported: let the CAM program write every move"
_FEED = "only feed per minute, G94, is supported"
_REASONS = {
    **dict.fromkeys((410, 411, 420, 421), _RADIUS),
    **dict.fromkeys((100, 431, 432, 520, 541, 922, 923), _OFFSET),
    **dict.fromkeys((740, 760, *range(840, 900)), _CYCLE),
    **dict.fromkeys((930, 950), _FEED),
    **dict.fromkeys((50, 51, 52, 53), "splines are not supported: let the CAM program write lines and arcs"),
    **dict.fromkeys((500, 510, 511, 680), "scaling and rotation are not supported: let the CAM program do them"),
    650: "macros are not supported: let the CAM program write every move",
}
_M_REASONS = {
    **dict.fromkeys((97, 98, 99), "subprograms are not supported: let the CAM program write every move"),
    **dict.fromkeys((21, 22, 23), "on many machines it mirrors the axes: let the CAM program do that"),
    **dict.fromkeys((24, 25, 26, 32, 47, 808), "it changes which lines are carried out: write every move"),
    **dict.fromkeys((70, 71, 72, 73), "it changes the modes in force by what is not in the file: write the modes"),
    **dict.fromkeys((92, 206, 208, 218, 290, 428, 665, 666, 669, 851), "it changes the coordinates"),
    **dict.fromkeys((125, 584, 600, 701, 702), "it moves the tool to where the file does not say"),
}
_LETTERS = {
    **dict.fromkeys("ABCUVW", "only the axes X, Y and Z are supported"),
    **dict.fromkeys("IJKR", "it belongs to an arc, G2 or G3"),
    **dict.fromkeys("XYZ", "there is no motion that it belongs to: write G0, G1, G2 or G3"),
    **dict.fromkeys("PQ", "nothing in the line uses it, as G4, G64, an arc or a cycle would: take it away"),
    "L": "repetitions belong to a drilling cycle, G81 to G83",
    "O": "subprograms are not supported, and a program number stands alone at the beginning",
}


def groups(block: Block) -> dict[str, int]:
    """Return the code of each modal group in the block.

    Raises:
        ToolpathError: a code that is not supported, or two of one group.
    """
    found: dict[str, int] = {}
    for code in block.g:
        group = _GROUP_OF.get(code)
        if group is None:
            raise ToolpathError(f"G{code / 10:g} is not understood: {_REASONS.get(code, _POST)}", value=code / 10)
        if group in found:
            names = GROUPS[group]
            raise ToolpathError(f"{names[found[group]]} and {names[code]} exclude each other in one line")
        found[group] = code
    return found


def reason_to_refuse(code: int) -> str | None:
    """Return the reason why an M code cannot be passed over, or None if it moves nothing."""
    return _M_REASONS.get(code)


def check_letters(block: Block, allowed: str) -> None:
    """Check that the block has no word that nothing in it uses; F, S and T may stand anywhere."""
    for letter in block.words:
        if letter not in "FST" and letter not in allowed:
            reason = _LETTERS.get(letter, "nothing in the line uses it")
            raise ToolpathError(
                f"{letter}{block.words[letter]:g} is not understood here: {reason}", value=block.words[letter]
            )
