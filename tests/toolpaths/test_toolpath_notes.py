"""What readers pass over is told once a kind, with its count and lines; toolpaths print in one line."""

from __future__ import annotations

import warnings

import pytest

from pathcontrol import InputError, read_csv, read_dxf, read_gcode, read_svg, read_toolpath
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.notes import Notes


def test_each_kind_is_one_sentence_with_its_count_and_lines():
    passed = Notes("warn")
    for line in (3, 5, 5):
        passed.unless_refused("M62", line, "M62 is not understood")
    passed.pass_over("TEXT", "layer 'NOTES'")
    passed.add("the layer 'Defpoints' is left out")
    passed.add("the layer 'Defpoints' is left out")
    assert passed.notes == (
        "the layer 'Defpoints' is left out",
        "M62 was passed over 3 times: lines 3, 5",
        "TEXT was passed over once: layer 'NOTES'",
    )


def test_a_million_things_are_a_short_text():
    passed = Notes("warn")
    for number in range(20_000):
        passed.pass_over(f"M{number % 2000}", number)
    assert len(passed.notes) == 51
    assert max(map(len, passed.notes)) < 200
    assert passed.notes[-1] == "1950 more kinds were passed over"
    assert passed.notes[0].endswith("lines 0, 2000, 4000, 6000, 8000, 10000, 12000, 14000, …")


def test_what_is_not_understood_is_refused_by_default():
    with pytest.raises(ToolpathError, match="it is odd, or pass it over with unknown='warn'"):
        Notes().unless_refused("it", 3, "it is odd")


@pytest.mark.parametrize("reader", [read_csv, read_gcode, read_svg, read_dxf])
def test_all_readers_know_the_choice(reader):
    with pytest.raises(InputError, match="unknown = 'ignore', expected one of 'refuse', 'warn'"):
        reader("nowhere", unknown="ignore")


def test_toolpaths_of_many_contours_print_in_one_line(tmp_path):
    path = tmp_path / "many.ngc"
    path.write_text("G21 G90 F600\nG0 X0 Y0 Z0\n" + "".join(f"G1 X{k}\nG0 Y{k}\n" for k in range(1, 300)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        toolpath = read_toolpath(path, unknown="warn")
    assert repr(toolpath) == f"Toolpath({str(path)!r}; 299 cuts, 0.299 m; 299 rapids, 0.299 m; file in mm)"
    assert repr(toolpath[0]) == "Contour('line 3'; 1 segment, 0.001 m, 0.01 m/s)"
    assert len(repr(toolpath.contours[:2])) < 200
