"""G-code: what a program says is what is read, and what is not understood is refused by its line."""

from __future__ import annotations

import tempfile
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import InputError
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.gcode import read_gcode
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import Polyline

HEAD = "G21 G90\nG0 X0 Y0 Z0\n"


def read(program: str | bytes, **options) -> Toolpath:
    with tempfile.NamedTemporaryFile(suffix=".nc") as file:
        Path(file.name).write_bytes(program.encode() if isinstance(program, str) else program)
        return read_gcode(file.name, **options)


def same(one: Toolpath, other: Toolpath, atol: float = 1e-12) -> None:
    """Contours of the same kind, feed and geometry; names and units may differ."""
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert (a.rapid, a.closed, len(a.segments)) == (b.rapid, b.closed, len(b.segments))
        assert a.feed == pytest.approx(b.feed)
        for s, t in zip(a.segments, b.segments, strict=True):
            u = np.linspace(0, 1, 7)
            assert np.allclose(s.point(u), t.point(u), rtol=0, atol=atol)


millimetres = st.integers(-99_999, 99_999).map(lambda thousandths: thousandths / 1000)
places = st.tuples(millimetres, millimetres, millimetres).filter(any)


class Move(NamedTuple):
    """A rapid, a cut, or a full circle about a centre beside the point, at a feed [mm/min]."""

    kind: int
    point: tuple[float, ...]
    feed: int

    def block(self, here: tuple[float, ...] = (0.0, 0.0, 0.0), unit: float = 1.0) -> str:
        """The line of the program, relative to ``here``, in a unit of so many millimetres."""
        values = dict(zip("XYZ", np.subtract(self.point, here), strict=True)) | {"F": self.feed}
        if self.kind == 2:
            values |= {"I": 3.5, "J": 1.25}
        return f"G{self.kind} " + " ".join(f"{w}{np.format_float_positional(v / unit)}" for w, v in values.items())


@st.composite
def programs(draw: st.DrawFn) -> list[Move]:
    """Moves that all have a length, the last one a rapid."""
    moves = []
    for point in draw(st.lists(places, min_size=1, max_size=9, unique=True)):
        kind, feed = draw(st.sampled_from([0, 1, 1, 2])), draw(st.sampled_from([100, 250]))
        moves += [Move(min(kind, 1), point, feed), Move(2, point, feed)][: max(kind, 1)]
    return [*moves, Move(0, (200.0, 200.0, 200.0), 100)]


def text(program: list[Move]) -> str:
    return HEAD + "\n".join(move.block() for move in program)


def test_a_program_as_cam_writes_it():
    toolpath = read(
        """%
        O1000 (POCKET; FINISH)
        N10 G21 G17 G90 G40 G49 G80 G94 G54
        N20 T1 M6
        N30 G0 X0. Y0.
        N40 G43 H1 Z5. M3 S12000
        N50 G1 Z-1. F100.
        N60 X10. F600. ; to the right
        N70 G3 X20. Y10. I0. J10. (a quarter)
        g2x30y20r10
        N80 G0 Z5.
        N90 G28 G91 Z0.
        N100 M30
        %
        G99 this is not read""".replace("        ", "")
    )
    assert toolpath.unit == "mm"
    assert [(c.name, c.rapid) for c in toolpath] == [("N50", False), ("N60", False), ("N80", True)]
    assert [c.feed for c in toolpath] == pytest.approx([0.1 / 60, 0.6 / 60, None])
    assert [type(s) for s in toolpath[1].segments] == [Polyline, Arc, Arc]
    assert np.allclose([toolpath[1].start, toolpath[1].end], [[0, 0, -1e-3], [0.03, 0.02, -1e-3]])
    assert toolpath[1].length == pytest.approx(0.01 + np.pi * 0.01)


@given(programs())
def test_relative_programs_are_absolute_ones(program):
    places = [(0.0, 0.0, 0.0), *(move.point for move in program)]
    blocks = [move.block(here) for move, here in zip(program, places, strict=False)]
    same(read(HEAD + "G91\n" + "\n".join(blocks)), read(text(program)))


@given(programs())
def test_inches_are_25_4_millimetres(program):
    toolpath = read(HEAD.replace("G21", "G20") + "\n".join(move.block(unit=25.4) for move in program))
    assert toolpath.unit == "in"
    same(toolpath, read(text(program)))


@settings(max_examples=10)
@given(programs(), st.data())
def test_spelling_does_not_matter(program, data):
    """Order of words, case, blanks, leading zeros, comments, line numbers, and saying again what is in force."""
    lines, motion = [], 0
    for number, move in enumerate(program):
        g, *words = move.block().split()
        if move.kind != motion or data.draw(st.booleans()):
            words.append(g.replace("G", "G0"))
        motion = move.kind
        blank = data.draw(st.sampled_from([" ", "", "\t", " (X99) "]))
        line = data.draw(st.sampled_from([str.upper, str.lower]))(blank.join(data.draw(st.permutations(words))))
        end = data.draw(st.sampled_from(["", " ; M99", "\r", "\n\n", "\n( )"]))
        lines.append(data.draw(st.sampled_from(["", f"N{number} "])) + line + end)
    same(read(HEAD + "\n".join(lines)), read(text(program)))


@given(programs())
def test_each_run_of_cuts_at_one_feed_is_a_contour_and_so_is_each_run_of_rapids(program):
    toolpath = read(text(program))
    runs = [feed for feed, _ in groupby(program, lambda move: None if move.kind == 0 else move.feed / 6e4)]
    assert [c.feed for c in toolpath] == pytest.approx(runs)
    assert [c.rapid for c in toolpath] == [feed is None for feed in runs]
    firsts = [
        3 + i
        for i, m in enumerate(program)
        if i == 0 or (m.kind and m.feed) != (program[i - 1].kind and program[i - 1].feed)
    ]
    assert [c.name for c in toolpath] == [f"line {line}" for line in firsts]
    assert np.allclose([c.end for c in toolpath][:-1], [c.start for c in toolpath][1:], rtol=0, atol=1e-12)
    assert np.allclose(toolpath[-1].end, 0.2)


def test_order_within_a_line_is_that_of_the_standard():
    """Feed, plane, unit and distance mode take effect before the motion of their line, M30 after it."""
    line = read("G0 X1 Y2 Z3 G90 G21\nX5 G91 G1 Y1 F60 M30\nX1")
    assert np.allclose(line[0].end, [6e-3, 3e-3, 3e-3])
    assert line[0].feed == pytest.approx(1e-3)
    quarter = read(HEAD + "G2 X1 Z1 K1 F60 G18")
    assert np.allclose(quarter[0].end, [1e-3, 0, 1e-3])


def test_where_the_tool_begins_is_not_guessed():
    known_later = read("G21\nG0 X1\nG0 Z5\nG0 Y2\nG0 X3 Y4\nG1 Z0 F60")
    assert [c.name for c in known_later] == ["line 5", "line 6"]
    assert np.allclose(known_later[0].start, [1e-3, 2e-3, 5e-3])
    flat = read("G21\nG0 X1 Y2\nX3\nG1 X4 F60 (Z is nowhere)")
    assert [c.rapid for c in flat] == [True, False]
    assert np.allclose(flat[1].end, [4e-3, 2e-3, 0])
    again = read(HEAD + "G1 X5 F60\nG28 Z9\nG0 X0\nZ3\nX2")
    assert np.allclose([again[-1].start, again[-1].end], [[0, 0, 3e-3], [2e-3, 0, 3e-3]])
    relative = read("G91 G20\nG1 X1 F60\nY1", start=[0.1, 0.2, 0.3])
    assert np.allclose([relative[0].start, relative[0].end], [[0.1, 0.2, 0.3], [0.1254, 0.2254, 0.3]])
    assert np.allclose(read("G0 X1 Y0 Z0\nX2", unit="in")[0].end, [0.0508, 0, 0])


def test_a_contour_that_returns_is_closed():
    square = "G1 X1 F60\nY1\nX0\nY0"
    assert read(HEAD + square)[0].closed
    assert not read(HEAD + square.rsplit("\n", 1)[0])[0].closed


REFUSED = {
    "hello": "'hello' is not understood: expected words",
    "G1 X": "'X' is not understood",
    "G1 X1e3": "E3 is not understood here: extruders",
    "G1 X1.2.3": r"'\.3' is not understood",
    "G1 X1 2": "'2' is not understood",
    "G1 X--1": "'X--1' is not understood",
    "G1 X1,5": "',5' is not understood",
    "G1 X١": "'X١' is not understood",
    "G1 X1 X2": "X2 is not the first X of the line",
    "G1 N5 X1": "N5 is not the first word of the line",
    "G1 X1 (open": "a comment begins with",
    "G1 X1 ((nested))": "a comment begins with",
    "G1 X1)": "a comment ends",
    "/G1 X1": "depends on a switch of the machine",
    "#1=5": "parameters are not supported",
    "G1 X#1": "parameters are not supported",
    "G1 X[1+2]": "expressions are not supported",
    "o100 call": "subprograms and control flow",
    "O100": "a second program begins",
    "O100 G1": "O100 is not understood here",
    "M98 P100": "M98 is not understood: subprograms",
    "M1.5": "M1.5 is not understood",
    "M321": "M321 is not understood: delete it if it moves nothing, or pass it over with unknown='warn'",
    "M5 M98": "M98 is not understood: subprograms",
    "M22": "M22 is not understood: on many machines it mirrors",
    "G1 X1 *71": "checksums",
    "G1 X1 %": "a % must stand alone",
    "$H": "'\\$H' is not understood",
    "G5 X1 Y1": "G5 is not understood: splines",
    "G7": "G7 is not understood: it may move the tool",
    "G1.05 X1": "G1.05 is not understood",
    "G10 L2 P1": "offset that is not in the file",
    "G41 D1": "G41 is not understood: the path depends on a radius",
    "G51 X2": "scaling and rotation",
    "G53 G1 X1": "G53 cuts in the machine's coordinates",
    "G55": "G55 after coordinates in G54: .* refer the program to one origin",
    "G84 Z-1 R2": "of the canned cycles only G73 and G81 to G83",
    "G52 X0": "offset that is not in the file",
    "G93": "only feed per minute",
    "G95": "only feed per minute",
    "G0 G1 X1": "G0 and G1 exclude each other",
    "G90 G91": "G90 and G91 exclude each other",
    "G28 G1 X1": "G28 or G30 and a motion exclude",
    "G80\nX1": "no motion that it belongs to",
    "G1 X1 U90": "only the axes X, Y and Z",
    "G1 X1 E2": "extruders",
    "G1 X1 P2": "nothing in the line uses it, as G4, G64, an arc or a cycle would: take it away",
    "G1 X1 H2": "H2 is not understood here: it names a tool's measure that nothing here uses",
    "G1 X1 I2": "it belongs to an arc",
    "G4 Y2": "Y2 is not understood here",
    "G4": "a time to wait",
    "G4 P-1": "a time to wait",
    "G1 X1 F0": "F0 is no feed",
    "G1 X1 F-5": "F-5 is no feed",
    "F" + "9" * 400: "Finf is no feed",
    "G20 F10": "where the unit changes",
    "G1 X99999999": "further than 10000 m",
    "G1 X" + "9" * 400: "further than 10000 m",
    "G28 Z0\nG1 X1": "it cuts where Z is not known",
    "G53 G0 X0\nG1 Y1": "it cuts where X is not known",
    "G30\nG1 Y1": "it cuts where X and Y and Z is not known",
}


@pytest.mark.parametrize("lines", REFUSED)
def test_what_is_not_understood_is_refused_by_its_line(lines):
    number = 4 + lines.count("\n")
    with pytest.raises(ToolpathError, match=rf"\.nc: line {number}: .*{REFUSED[lines]}"):
        read(HEAD + "F100\n" + lines + "\nG1 X1 Y1\n")


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("", "there is no move in it"),
        ("%\n(nothing)\n%\nG21 G0 X1", "there is no move in it"),
        ("M30\nG21 G0 X0 Y0 Z0\nG0 X1", "there is no move in it"),
        ("G21 G0 X1 Y1 Z1\nG0 X1", "there is no move in it"),
        ("G0 X1", "line 1: X1 has no unit: write G20"),
        ("F100", "line 1: F100 has no unit"),
        ("G21 G80\nX1", "line 2: X1 is not understood here: there is no motion"),
        (HEAD + "G1 X1", "line 3: it cuts before there is a feed"),
        ("G21 F60\nG1 X1 Y1", "line 2: it cuts where X and Y is not known"),
        ("G21 G91 F60\nG0 X1\nG1 X1", "line 3: it cuts where X is not known"),
    ],
)
def test_programs_that_say_too_little_are_refused(program, message):
    with pytest.raises(ToolpathError, match=message):
        read(program)


@pytest.mark.parametrize(
    "options",
    [
        {"unit": "cm"},
        {"unit": 1},
        {"start": [0, 0]},
        {"start": [0, 0, np.nan]},
        {"start": "home"},
        {"start": [0, 0, 1e9]},
    ],
)
def test_wrong_arguments_are_named(options):
    with pytest.raises(InputError, match=next(iter(options))):
        read(HEAD + "G0 X1", **options)
