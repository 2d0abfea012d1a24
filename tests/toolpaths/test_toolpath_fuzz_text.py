"""Whatever a text file holds, its reader gives finite numbers or one of this package's errors."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.csv.reader import read_csv
from pathcontrol.toolpaths.gcode import read_gcode

CSV = (
    "x [mm], y [mm], z [mm], i, j, k\n0, 0, 0, 0, 0, 1\n10, 0.5, -2e1, 0, 1, 1 # edge\n\n"
    "3, 4, 5, 1, 0, 0\n6, 7, 8, 1, 1, 0\n"
)
GCODE = (
    "%\nO1 (PART)\nN10 G21 G90 G17\nN20 G0 X0 Y0 Z5.\nG1 Z-1 F100\nX10 Y-2.5\nG2 X20 Y-2.5 I5 J0\nG3 X30 R-8\n"
    "G91 G20 G1 X.1\nG18 G2 X1 I.5\nG4 P1\nG28 Z0\nG90 G0 Z1\nM30\n%\n"
)
READERS = {read_csv: CSV, read_gcode: GCODE}


def check(reader, data: bytes) -> bool:
    """Whether the reader takes the file, and what it then gives is sound."""
    with tempfile.NamedTemporaryFile() as file:
        Path(file.name).write_bytes(data)
        contours, message = (), ""
        try:
            contours = reader(file.name).contours
        except ToolpathError as error:
            message = str(error)
    assert contours or (message.startswith(file.name) and len(message) < 600)
    for contour in contours:
        assert np.isfinite([contour.bounds, (contour.start, contour.end)]).all()
        assert 0 < contour.length < np.inf
        assert contour.normals is None or np.allclose(np.linalg.norm(contour.normals, axis=-1), 1)
    return bool(contours)


@pytest.mark.parametrize("reader", READERS)
def test_the_seeds_are_valid(reader):
    assert check(reader, READERS[reader].encode())


@pytest.mark.parametrize("reader", READERS)
@settings(max_examples=60)
@given(data=st.binary(max_size=200) | st.text(max_size=100).map(lambda text: text.encode("utf-8", "surrogatepass")))
def test_any_bytes(reader, data):
    check(reader, data)


NUMBERS = [
    "0",
    "1",
    "-1",
    ".5",
    "2.",
    "1e3",
    "1e-320",
    "1e308",
    "1e999",
    "9" * 400,
    "nan",
    "inf",
    "-",
    "",
    "1.2.3",
    "0x1F",
]


@pytest.mark.parametrize("reader", READERS)
@settings(max_examples=70)
@given(data=st.data())
def test_mutations_of_valid_files(reader, data):
    """Pieces cut out, doubled, moved and replaced, in bytes and in words."""
    text = READERS[reader].encode()
    pieces = (
        st.binary(max_size=3)
        | st.sampled_from(NUMBERS).map(str.encode)
        | st.sampled_from([b"\n", b" ", b"#", b";", b"("])
    )
    for _ in range(data.draw(st.integers(1, 4))):
        begin, end = sorted(data.draw(st.tuples(*[st.integers(0, len(text))] * 2)))
        end = min(end, begin + data.draw(st.sampled_from([0, 1, 2, 20])))
        piece = data.draw(pieces | st.just(text[begin:end] * 2) | st.just(text[::-1][begin:end]))
        text = text[:begin] + piece + text[end:]
    check(reader, text)


CODES = ["0", "1", "2", "3", "4", "17", "18", "19", "20", "21", "28", "53", "80", "90", "91", "90.1", "91.1"]
WORDS = (
    st.builds(str.__add__, st.sampled_from("GMXYZIJKRFPNSTHO"), st.sampled_from(NUMBERS))
    | st.sampled_from(CODES).map("G{}".format)
    | st.sampled_from(["X1", "Y2", "Z3", "X-1", "I1", "J-1", "K1", "R2", "F100", "P1", "N5", "M30", "%"])
)


@settings(max_examples=100)
@given(st.lists(st.lists(WORDS, min_size=1, max_size=5).map(" ".join), max_size=12))
@example(["G2 X1 I.0000001"])
@example(["G2 X.000001 R9999", "G3 X0 R-9999"])
def test_programs_of_random_words(blocks):
    check(read_gcode, "\n".join(["G21 G90 F100 G0 X0 Y0 Z0", *blocks]).encode())


@settings(max_examples=80)
@given(
    st.lists(st.lists(st.sampled_from([*NUMBERS, "x", "y", "z", "contour", "i", "#"]), max_size=7), max_size=6),
    st.sampled_from([" ", ",", ";", "\t"]),
)
def test_tables_of_random_values(table, separator):
    check(read_csv, "\n".join(separator.join(row) for row in table).encode())


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    "line",
    [
        b"X11111" * 16_000 + b"!",  # no number of ways to split the digits may be tried
        b"(" * 99_999,
        b"X" + b" " * 99_000 + b"1 ?",
        b"0" * 99_999 + b" 1 1",
        b"N" + b"9" * 99_998,
        b"#" * 99_999,
        b"[" * 99_999,
        b"x " * 49_999,
        b"1," * 49_999,
        b"-" * 99_999,
        b"%" + b" " * 99_000 + b"?",
        b"O" + b" " * 99_000 + b"?",
        b"\xff" * 99_999,
        b"._" * 49_999,
        b"# unit" + b" " * 99_000 + b"?",
        b"# " + b"x [" * 33_000,
        b"pos" * 33_000,
        b'"' * 99_999,
        b'" ' * 49_999,
        b"//" * 49_999,
        b"*" * 99_999,
        b"Xe-1" * 24_000 + b"!",
    ],
)
def test_long_lines_end_soon(reader, line):
    check(reader, READERS[reader].encode() + line + b"\n0 0 0")
    check(reader, line)


@pytest.mark.parametrize("reader", READERS)
def test_many_lines_end_soon(reader):
    """A tenth of a million points are read, and too many are an error before they fill the memory."""
    rows = {
        read_csv: b"0 0 0\n" + b"1 0 0\n0 1 0\n" * 50_000,
        read_gcode: b"G21 G90 G0 X0 Y0 Z0\nF100 G1\n" + b"X1\nX0Y1\n" * 50_000,
    }
    assert check(reader, rows[reader])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pathcontrol.toolpaths.csv.table.MAX_SEGMENTS", 9)
        patch.setattr("pathcontrol.toolpaths.gcode.strokes.MAX_SEGMENTS", 9)
        assert not check(reader, rows[reader])
