"""Lines that only say where a straight move leads are carried out many at once, and give what they give one by one."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.gcode import read_gcode
from pathcontrol.toolpaths.gcode.runs import read_run
from pathcontrol.toolpaths.gcode.words import PLAIN, parse
from pathcontrol.toolpaths.segments.segment import Polyline

lengths = st.sampled_from(["1", "2", "-3.5", "+2.5", "-.25", "007", "1.", "-0", ".0000001", "1.0000001", "12", "0"])
numbers = st.one_of(*[lengths] * 4, st.sampled_from(["1e-3", "1e2", "9999999", "20000000", "2..3", ""]))
codes = st.sampled_from(["", "", "", "", "G0", "G1", "G01", "g1", "G 1", "G001", "G1.0", "G90", "G91"])
feeds = st.sampled_from(["", "", "", "F600", "F600.", "F100", "S1000"])
ends = st.sampled_from(["", "", "", " (rest)", " ; rest", "\t"])
_OTHERS = "G2 X1 I3|G1 X1 Y1 R2|G81 Z-1 R2|G0 G4 P1|G20|G80|G28|G92 X1|F200|M30|%|O2|/ X1|(x)|X1 X2|F0|X1 F-600|X1 F6e2"
others = st.sampled_from([*_OTHERS.split("|"), "", "M8", "X1 E1", "Y1 M62 P1", "X1 *71", "X1 // no", "X1 G2"])


@st.composite
def lines(draw: st.DrawFn, values: st.SearchStrategy[str] = numbers) -> str:
    """A line, most often one of a straight move."""
    axes = st.tuples(st.sampled_from("XYZxyz"), values)
    words = draw(st.lists(axes, max_size=3, unique_by=lambda word: word[0].upper()))
    label, blank = draw(st.sampled_from(["", "", "N10 ", "n020"])), draw(st.sampled_from(["", " ", "  "]))
    parts = [draw(codes), *map("".join, words), draw(feeds)]
    return label + blank.join(part for part in parts if part) + draw(ends)


programs = st.lists(st.one_of(*[lines(lengths)] * 7, lines(), others), max_size=14)


def read(program: list[str], **options) -> Toolpath | str:
    """The toolpath, or what is wrong with the program."""
    with tempfile.NamedTemporaryFile(suffix=".nc") as file:
        Path(file.name).write_text("\n".join(program))
        try:
            return read_gcode(file.name, **options)
        except ToolpathError as error:
            return str(error).partition(": ")[2]


def one_by_one(monkeypatch: pytest.MonkeyPatch, program: list[str], **options) -> Toolpath | str:
    """What :func:`read` gives where every line is carried out by itself."""
    with monkeypatch.context() as patch:
        patch.setattr("pathcontrol.toolpaths.gcode.program.read_run", lambda *_: (0, np.empty((0, 3))))
        return read(program, **options)


def assert_the_very_same(found: Toolpath | str, expected: Toolpath | str) -> None:
    if isinstance(found, str) or isinstance(expected, str):
        assert found == expected
        return
    assert (found.unit, found.notes, len(found)) == (expected.unit, expected.notes, len(expected))
    for a, b in zip(found, expected, strict=True):
        assert (a.name, a.feed, a.rapid, a.closed) == (b.name, b.feed, b.rapid, b.closed)
        assert [type(s) for s in a.segments] == [type(s) for s in b.segments]
        u = np.linspace(0.0, 1.0, 5)
        for s, t in zip(a.segments, b.segments, strict=True):
            same = (
                s.points.tobytes() == t.points.tobytes()
                if isinstance(s, Polyline)
                else (s.point(u) == t.point(u)).all()
            )
            assert same


@settings(max_examples=40)
@given(programs, st.sampled_from(["refuse", "warn", "warn"]))
def test_runs_give_what_single_lines_give(program, unknown):
    program = ["G21 G90", "G0 X0 Y0 Z5", "G1 X1 F600", *program]
    with pytest.MonkeyPatch.context() as patch:
        assert_the_very_same(read(program, unknown=unknown), one_by_one(patch, program, unknown=unknown))


@given(st.one_of(lines(), others))
def test_a_plain_line_has_the_words_that_the_parser_finds(line):
    found = PLAIN.fullmatch(line)
    if found is not None:
        block = parse(line)
        words = dict(zip("GXYZF", found.groups(), strict=True))
        assert block.g == ([] if words["G"] is None else [10 * int(words["G"])])
        assert block.words == {letter: float(text) for letter, text in words.items() if text and letter != "G"}
        assert not block.m


@pytest.mark.parametrize("line", ["X1", "N10 G1 X1.5 Y-2 Z.5", "g01x1y2", "G0 Z5", "X1 F600", "", "N20", "G1 Y2 F6.E"])
def test_the_commonest_lines_are_plain(line):
    assert bool(PLAIN.fullmatch(line)) != line.endswith("E")


@pytest.mark.parametrize("mode", ["G90", "G91"])
def test_a_run_is_taken_whole_and_ends_before_the_first_line_that_says_more(monkeypatch, mode):
    """The law above would hold if nothing were ever taken together."""
    taken = []

    def spy(*arguments):
        result = read_run(*arguments)
        taken.append(result[0])
        return result

    monkeypatch.setattr("pathcontrol.toolpaths.gcode.program.read_run", spy)
    moves = [f"X{k}.5 Y{k * k}" for k in range(20)]
    toolpath = read(["G21 G90", "G0 X0 Y0 Z0", f"{mode} G1 X1 Y1 F600", *moves, "M8", *moves, "M30"])
    assert (max(taken), sum(taken)) == (19, 38)  # the first line after one of another kind is looked at alone
    assert isinstance(toolpath, Toolpath)
    assert toolpath[-1].points == 1 + 1 + 40


def test_an_error_within_a_run_names_its_line():
    moves = [f"X{k}" for k in range(1, 50)]
    program = ["G21 G90", "G0 X0 Y0 Z0", "G1 X1 F600", *moves, "X10000001", *moves]
    assert str(read(program)).startswith(f"line {4 + len(moves)}: X1e+07 leads further than 10000 m")


def test_the_most_moves_are_as_many_in_a_run(monkeypatch):
    monkeypatch.setattr("pathcontrol.toolpaths.gcode.strokes.MAX_SEGMENTS", 10)
    program = ["G21 G90", "G0 X0 Y0 Z0", "G1 X1 F600", *(f"X{k}" for k in range(2, 30))]
    assert (
        str(read(program)) == str(one_by_one(monkeypatch, program)) == "line 13: more than 10 moves; split the program"
    )
