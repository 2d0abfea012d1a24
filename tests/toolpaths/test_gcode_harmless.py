"""G-code that moves the same: words that move nothing change nothing, what could move the tool is never passed over."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_gcode import HEAD, programs, read, same, text

from pathcontrol.errors import ToolpathError

#: lines that any control takes without a move, read by default
ALWAYS = [
    "M62 P0",
    "M63 P1",
    "M64P2",
    "M65 P3",
    "M68 E0 Q2.5",
    "M66 P0 L3 Q5",
    "M19 R90",
    "M48",
    "M51 P1",
    "G98",
    "G99",
]
ALWAYS += [
    "G05 P10000",
    "G5.1 Q1",
    "G187 P2 E0.01",
    "G08 P1",
    "G9",
    "G62",
    "G69",
    "G15",
    "A0.",
    "B0 C0",
    "G4 X1.5",
    "G4 S2",
]
#: lines that are passed over on request
LENIENT = [
    "M104 S200",
    "M400",
    "M107",
    "M106 P1 S255",
    "M82",
    "M203 X500 Y500 Z10 E50",
    "M84 X0 Y0",
]
LENIENT += [
    "M117 Layer 1 of 9",
    "[ New model Wed Jun 1 17:10:59 2022 ]",
    "// made by hand",
    "M321",
    "E2.5",
    "D1",
    "G92 E0",
]
LENIENT += ["M5 *71", "H3"]
#: what could move the tool, shift its coordinates or change the order of lines
NEVER = [
    "G84 Z-1 R2",
    "G41 D1",
    "G68 R90",
    "G10 L2 P1 X1",
    "O100 sub",
    "#1=5",
    "X#1",
    "X[1+2]",
    "M98 P1",
    "M99",
    "M22",
    "M72",
]
NEVER += [
    "G51 X2",
    "G7",
    "G54\nG55",
    "G2.1 X1",
    "G5 X1 Y1 I1 J1 P1 Q1",
    "M47",
    "/G1 X1",
    "//G1 X1",
    "$H",
    "M206 X5",
    "A9",
    "U1",
]
NEVER += ["M321 X5", "G1 X1 M321 P2", "G2 X2 I1 M62 P2", "G92 X5", "G28 A0", "hello", "G28.1", "G38.2 Z-1", "G65 P9000"]


@given(programs(), st.lists(st.tuples(st.sampled_from(ALWAYS), st.integers(0, 99)), max_size=4))
def test_lines_that_move_nothing_change_nothing(program, more):
    lines = text(program).split("\n")
    for line, where in more:
        lines.insert(2 + where % (len(lines) - 1), line)
    same(read("\n".join(lines)), read(text(program)))


@pytest.mark.parametrize("line", LENIENT)
def test_what_is_not_understood_is_passed_over_on_request_and_told(line):
    program = "G1 X1 F60\n{}\nX2\n{}\nX3"
    with pytest.raises(ToolpathError, match=r"line 4: .*, or pass it over with unknown='warn'"):
        read(HEAD + program.format(line, line))
    lenient = read(HEAD + program.format(line, line), unknown="warn")
    same(lenient, read(HEAD + program.format("", "")))
    (note,) = lenient.notes
    assert note.endswith("was passed over 2 times: lines 4, 6")


@pytest.mark.parametrize("line", NEVER)
def test_what_could_move_the_tool_is_never_passed_over(line):
    with pytest.raises(ToolpathError, match=f"line {4 + line.count(chr(10))}: "):
        read(HEAD + f"G1 X1 F60\n{line}\nX2", unknown="warn")


def test_each_kind_is_told_once_with_its_lines():
    toolpath = read(HEAD + "M62 P0\nG1 X1 F60 M62 P1\nM63 P0\nA0 X2\nX3 M8 M3 S100 T1")
    assert toolpath.notes == (
        "M62 was passed over 2 times: lines 3, 4",
        "M63 was passed over once: line 5",
        "A, an axis that stays where it is, was passed over once: line 6",
    )
    assert toolpath[0].end == pytest.approx([3e-3, 0, 0])


def test_a_printer_word_moves_with_its_line():
    program = HEAD + "G1 X1 Y0 E.05 F600\nG1 E-5 F1800\nG92 E0\nG1 X2 E.1 F600"
    toolpath = read(program, unknown="warn")
    assert [c.end[0] for c in toolpath] == pytest.approx([2e-3])
    assert toolpath.notes == ("E was passed over 4 times: lines 3, 4, 5, 6",)


@pytest.mark.parametrize("turn", ["A90\nG1 X1 F60\nA91 X2", "G1 X1 F60\nA90 X2", "G91 A1 X1", "A5\nG91 X1 A5"])
def test_a_rotary_axis_may_stay_but_not_turn(turn):
    with pytest.raises(ToolpathError, match=r"turns A from .*: only X, Y and Z are supported"):
        read(HEAD + turn)
    assert read(HEAD + "A90\nG1 X1 F60\nA90 X2\nG91 X1 A0")[0].length == pytest.approx(3e-3)


def test_exponents_are_read_where_they_cannot_be_an_extruder():
    toolpath = read(HEAD + "G1 X2.35e-12 Y1e+01 F6.e+02\nG2 X5 Y1.5e+1 I5e+00 J0")
    assert np.allclose(toolpath[0].start, 0)
    assert toolpath[0].segments[0].points[-1] == pytest.approx([2.35e-15, 0.01, 0], rel=1e-12)
    assert toolpath[0].end == pytest.approx([0.005, 0.015, 0])
    assert toolpath[0].feed == pytest.approx(0.01)
    for both in ("x1e-3", "N5e-1 X1", "G1e-5 X1"):
        with pytest.raises(ToolpathError, match="may be a number with an exponent"):
            read(HEAD + both, unknown="warn")
    assert read(HEAD + "G1 X1E-5 F60", unknown="warn")[0].length == pytest.approx(1e-3)  # upper case is a word


def test_g92_at_the_beginning_says_where_the_tool_is():
    toolpath = read("G21 G92 X0 Y0 Z-1\nG0 Z4\nF400\nG1 Z-1\nY.876")
    assert [c.rapid for c in toolpath] == [True, False]
    assert np.allclose(toolpath[0].start, [0, 0, -1e-3])
    assert toolpath[1].length == pytest.approx(5.876e-3)
    same(read(HEAD + "G92.1\nG1 X5 F60\nG92 X5\nX6"), read(HEAD + "G1 X5 F60\nX6"))
    for later in ("G1 X5 F60\nG92 X0", "G0 X5\nG92 X0", "G92 X3\nG92.1"):
        with pytest.raises(ToolpathError, match="shifts the coordinates"):
            read(HEAD + later)


@pytest.mark.parametrize("far", ["9" * 400, "-99999999"])
def test_g92_leads_nowhere_far(far):
    with pytest.raises(ToolpathError, match=r"line 1: X.* leads further than 10000 m from the origin"):
        read(f"G21 G92 X{far} Y0 Z0\nG1 X1 F60")


def test_one_coordinate_system_is_as_good_as_another():
    toolpath = read("G21 G90 G56\nG0 X0 Y0 Z0\nG1 X1 F60")
    same(toolpath, read(HEAD + "G1 X1 F60"))
    assert toolpath.notes == ("the coordinates are those of G56",)
    with pytest.raises(ToolpathError, match="G55 after coordinates in G56"):
        read("G21 G90 G56\nG0 X0 Y0 Z0\nG55 G1 X1 F60", unknown="warn")


def test_places_before_the_first_motion_are_rapids():
    toolpath = read("G21\nG28 G91 Z0\nG90\nT1 M6\nZ10\nG54\nG0 X10 Y20\nG1 Z-1 F200\nX20\nM30")
    same(toolpath, read("G21 G0\nZ10\nX10 Y20\nG1 Z-1 F200\nX20"))
    assert toolpath.notes == ("line 5: it moves before G0 or G1 is said; that is taken for rapids, as grbl does",)
    assert np.allclose(read("G21 G53 Z0\nX1 Y1 Z1\nX2")[0].length, 1e-3)


def test_a_program_without_a_feed_takes_the_one_that_is_given():
    toolpath = read(HEAD + "G1 X5\nX6 F60", feed=0.02)
    assert [c.feed for c in toolpath] == pytest.approx([0.02, 0.001])
    with pytest.raises(ToolpathError, match=r"there is a feed: write F, .* or read the file with feed="):
        read(HEAD + "G1 X5")


def test_the_progress_of_a_printer_is_passed_over_and_the_mode_m73_is_not():
    """M73 with P or R shows progress; alone it restores the modes of the program that called."""
    moves = "G1 X10 F600\n{}\nG1 Y5\n"
    plain = read(HEAD + moves.format("(-)"))
    for progress in ("M73 P5 R10", "M73 P100", "M73 R0"):
        with pytest.raises(ToolpathError, match=r"unknown='warn'"):
            read(HEAD + moves.format(progress))
        same(read(HEAD + moves.format(progress), unknown="warn"), plain)
    with pytest.raises(ToolpathError, match="modes in force"):
        read(HEAD + moves.format("M73"), unknown="warn")


@pytest.mark.parametrize("cut", ["G1 X10 C90", "G2 X10 I5 A-30", "G1 Z-1 B5"])
def test_an_axis_that_turns_in_the_first_cut_is_refused(cut):
    """An axis stands at 0 until a move without a cut says where it is."""
    letter = next(c for c in cut if c in "ABC")
    with pytest.raises(ToolpathError, match=f"turns {letter} from 0"):
        read(HEAD + "F600\n" + cut + "\n", unknown="warn")
    turned = cut[cut.index(letter) :]
    found = read(HEAD + f"F600\nG0 X0 Y0 Z0 {turned}\n" + cut + "\n")
    same(found, read(HEAD + "F600\n" + cut[: cut.index(letter)] + "\n"))
