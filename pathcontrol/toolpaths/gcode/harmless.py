"""Removal of words of G-code that move nothing: those that never do, and those ignored on request.

What could move the tool, shift its coordinates or change the order of lines is never passed over.
"""

from __future__ import annotations

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.codes import KNOWN_G, KNOWN_M, reason_to_refuse
from pathcontrol.toolpaths.gcode.words import Block
from pathcontrol.toolpaths.notes import Notes

#: G codes times ten, with the letters that belong to them: smoothing, look-ahead, exact stops, speed of the cut
_SMOOTHING = {50: "PR", 51: "QR", 80: "P", 90: "", 620: "", 960: "D", 1030: "P", 1870: "PE"}
#: M codes with the letters that belong to them: orientation of the spindle, overrides, outputs and inputs
_OUTPUTS = {10: "", 11: "", 19: "RPQ", **dict.fromkeys((48, 49, 50, 51, 52, 53), "P")}
_OUTPUTS |= dict.fromkeys((62, 63, 64, 65, 66, 67, 68), "PELQ")
#: M codes of printers whose axis words are no places: motors off, accelerations, speeds, jerks, currents
_PRINTERS = frozenset({17, 18, 84, 201, 202, 203, 204, 205, 350, 566, 906, 907})
_PLACES = frozenset("XYZIJK")


def without_codes(block: Block, turning: bool, line: int, passed: Notes) -> Block:
    """Return the block without G and M codes that move nothing, and the words that belong to them.

    Args:
        block: the block.
        turning: whether the motion in force is an arc or a cycle, which P, Q, R and L belong to as well.
        line: its number.
        passed: what is passed over is counted there.

    Raises:
        ToolpathError: there are M codes that are to be refused, or whose words could be of the motion.
    """
    if KNOWN_G.issuperset(block.g) and KNOWN_M.issuperset(block.m):
        return block
    letters: set[str] = set()
    for code in block.g:
        if code in _SMOOTHING and _smooths(code, block):
            passed.pass_over(f"G{code / 10:g}", line)
            letters |= {*_SMOOTHING[code]}
    for code in block.m:
        if code not in KNOWN_M:
            letters |= _of_m(code, block, line, passed)
    mixed = sorted(letters & {*"PQRL"} & block.words.keys())
    if turning and mixed and not _PLACES.isdisjoint(block.words):
        raise ToolpathError(
            f"{mixed[0]} belongs to the motion, or to a code that moves nothing: give each its own line"
        )
    return block._replace(
        g=[code for code in block.g if not (code in _SMOOTHING and _smooths(code, block))],
        m=[code for code in block.m if code in KNOWN_M],
        words={letter: value for letter, value in block.words.items() if letter not in letters},
    )


def without_letters(block: Block, line: int, passed: Notes) -> Block:
    """Return the block without E, and without D and H that nothing in it uses.

    Raises:
        ToolpathError: they are to be refused.
    """
    found = [letter for letter in "DEH" if letter in block.words and not (letter == "H" and 430 in block.g)]
    for letter in found:
        what = (
            "extruders are not supported; take it away"
            if letter == "E"
            else "it names a tool's measure that nothing here uses; take it away"
        )
        reason = f"{letter}{block.words[letter]:g} is not understood here: {what}"
        passed.unless_refused(letter, line, reason)
    if not found:
        return block
    return block._replace(words={letter: value for letter, value in block.words.items() if letter not in found})


def _smooths(code: int, block: Block) -> bool:
    """Return whether a G code is about smoothing: G5 and G5.1 are splines where there are coordinates."""
    return code not in (50, 51) or (_SMOOTHING[code][0] in block.words and _PLACES.isdisjoint(block.words))


def _shows_progress(code: int, block: Block) -> bool:
    """Return whether an M73 is of a printer: P % done, R minutes left; M73 alone restores modes."""
    return code == 73 and not {"P", "R"}.isdisjoint(block.words)


def _of_m(code: int, block: Block, line: int, passed: Notes) -> set[str]:
    """Return the letters that belong to an M code which is passed over."""
    if code in _OUTPUTS:
        passed.pass_over(f"M{code}", line)
        return {*_OUTPUTS[code]}
    if (reason := reason_to_refuse(code)) is not None and not _shows_progress(code, block):
        raise ToolpathError(f"M{code} is not understood: {reason}", value=code)
    if code in _PRINTERS and not block.g:
        letters = {*block.words}
    elif block.words.keys() & ({*"PQRLE"} if block.g else _PLACES):
        raise ToolpathError(
            f"M{code} is not understood, and shares its line with words that may be its own", value=code
        )
    else:
        letters = set() if block.g else {*block.words} - {"F"}
    passed.unless_refused(f"M{code}", line, f"M{code} is not understood: delete it if it moves nothing")
    return letters
