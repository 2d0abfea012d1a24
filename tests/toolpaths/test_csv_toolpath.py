"""Tables of points: every spelling of the same numbers is the same contour, and mistakes are found by their line."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import floats, vectors

from pathcontrol import InputError
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths import text
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.csv.reader import read_csv

METRES = {"m": 1.0, "mm": 0.001, "in": 0.0254}


def read(table: str | bytes, **options) -> Toolpath:
    with tempfile.NamedTemporaryFile(suffix=".csv") as file:
        Path(file.name).write_bytes(table.encode() if isinstance(table, str) else table)
        return read_csv(file.name, **options)


def rows(values: np.ndarray, separator: str = " ") -> str:
    return "\n".join(separator.join(map(repr, row)) for row in values.tolist())


@st.composite
def polylines(draw: st.DrawFn, least: int = 2) -> np.ndarray:
    """Points that are further apart than a nanometre, the last from the first too."""
    points = draw(st.lists(vectors(3, 9.0), min_size=least, max_size=8))
    return np.array(points) + np.arange(len(points))[:, None] * [20.0, 0, 0]


@given(
    polylines(),
    st.sampled_from(list(METRES)),
    st.sampled_from([" ", "\t", ";", ",", "  ", " , ", " ;"]),
    st.permutations("xyz"),
    st.sampled_from(["{} [{}]", "{}[{}]", "{}_{}", "{} ({})", '"{}_{}"']),
    st.booleans(),
)
def test_separators_columns_and_units(points, unit, separator, order, pattern, named):
    head = separator.join(pattern.format(name, unit) for name in order) if named else separator.join(order).upper()
    table = f"# points\n{head} # columns\n" + rows(points[:, ["xyz".index(name) for name in order]], separator)
    toolpath = read(table, **({} if named else {"unit": unit}), feed=0.02)
    (contour,) = toolpath
    assert toolpath.unit == unit
    assert np.allclose(contour.segments[0].points, points * METRES[unit], rtol=1e-15, atol=0)
    assert (contour.feed, contour.rapid, contour.closed, contour.normals) == (0.02, False, False, None)
    assert contour.name == "line 3"


@given(polylines(), st.integers(0, 99), floats(1e-200, 1e200))
def test_tool_axes_become_unit_vectors(points, seed, size):
    axes = np.random.default_rng(seed).normal(size=points.shape)
    (contour,) = read(rows(np.hstack([points, axes * size])), columns="x,y,z,nx,ny,nz")
    assert np.allclose(np.linalg.norm(contour.normals, axis=-1), 1)
    assert np.allclose(np.cross(contour.normals, axes), 0, atol=1e-12)
    assert ((contour.normals * axes).sum(-1) > 0).all()


@given(st.lists(polylines(), min_size=1, max_size=4))
def test_empty_lines_and_the_column_contour_begin_contours(parts):
    gaps = read("\n \t\n# a comment is no gap\n".join(rows(part) for part in parts))
    labels = "contour x y z\n" + "\n".join(
        f"part_{i} {row}" for i, part in enumerate(parts) for row in rows(part).split("\n")
    )
    named = read(labels)
    assert [c.name for c in named] == [f"part_{i}" for i in range(len(parts))]
    for part, one, other in zip(parts, gaps, named, strict=True):
        assert np.array_equal(one.segments[0].points, part)
        assert np.array_equal(other.segments[0].points, part)


@given(polylines(least=3), st.data())
def test_repeated_points_are_left_out(points, data):
    times = data.draw(st.lists(st.integers(1, 3), min_size=len(points), max_size=len(points)))
    noise = np.random.default_rng(0).uniform(-1e-10, 1e-10, (sum(times), 3))
    (contour,) = read(rows(np.repeat(points, times, axis=0) + noise))
    assert np.allclose(contour.segments[0].points, points, rtol=0, atol=1e-9)


@given(polylines(least=3))
def test_a_contour_is_closed_if_it_returns_to_its_first_point_and_axis(points):
    ring = np.vstack([points, points[:1]])
    up, tilted = np.tile([0.0, 0, 1], (len(ring), 1)), np.tile([0.0, 0, 1], (len(ring), 1))
    tilted[-1] = [0, 1, 1]
    assert not read(rows(points))[0].closed
    assert read(rows(ring))[0].closed
    assert read("x y z i j k\n" + rows(np.hstack([ring, up])))[0].closed
    assert not read("x y z nx ny nz\n" + rows(np.hstack([ring, tilted])))[0].closed


def test_a_slow_creep_is_not_lost():
    creep = np.arange(50)[:, None] * [0.4e-9, 0, 0]
    (contour,) = read(rows(creep))
    assert contour.length == pytest.approx(19.2e-9)  # 48 of 49 steps, three at a time


def test_text_of_other_systems_is_read():
    bom, latin, mac = "\ufeff0 0 0\r\n1 1 1".encode(), "# für\n0 0 0\n1 1 1".encode("latin-1"), b"0 0 0\r1 1 1\r"
    assert all(read(table)[0].length == pytest.approx(np.sqrt(3)) for table in (bom, latin, mac))


REFUSED = {
    "": "there is no point in it",
    "# 1 2 3": "there is no point in it",
    "x y z": "there is no point in it, only the names",
    "1 2": "line 1: 2 values between blanks and no names of columns, expected 3 .* x y alone need z=",
    "1,2,3,4": "line 1: 4 values between commas and no names of columns, expected 3",
    "1,2,3,": "line 1: the contour that begins here is one point",
    "0 0 0\n\n1 2": "line 3: 2 values between blanks, expected 3: x y z",
    "x,y,z\n1 2 3": "line 2: 1 values between commas, expected 3: x y z",
    "x,y,z\n1,2,3,4": "line 2: 4 values between commas, expected 3: x y z",
    "x,y,z,contour\n0,0,0,a\n1,1,1": "line 3: 3 values between commas, expected 4: x y z contour",
    "x,y,z,contour\n0,0,0,a\n1,q,1,b": "line 3: y = 'q', expected a number",
    "a b c\n0 0 0": "line 1: columns 'a b c', expected x, y and z, .* say which they are by columns= and unit=",
    "x_ft y_ft z_ft\n0 0 0": "line 1: columns 'x_ft y_ft z_ft', expected x, y and z",
    "x y z i_mm j k\n0 0 0 0 0 1": "line 1: columns 'x y z i_mm j k', expected .* none or all of i, j and k",
    "x y\n0 0": "line 1: columns 'x y', expected z too; .* needs z=",
    "x y z i j\n0 0 0 0 0": "line 1: columns 'x y z i j', expected x, y and z, and none or all of i, j and k",
    "x y z qx qy qz\n0 0 0 0 0 1": "line 1: columns 'x y z qx qy qz', expected .* or of qx, qy, qz and qw",
    "x y z i j k qx qy qz qw\n0": "line 1: columns .* expected a normal or an orientation, not both",
    "x y z z\n0 0 0 0": "line 1: columns 'x y z z', expected .* each once",
    "x_mm y_in z_mm\n0 0 0": "line 1: x, y and z in different units, 'in', 'mm'",
    "x_mm y z_mm\n0 0 0": "line 1: x, y and z in different units, 'mm', 'no unit'",
    "0 0 0 0 0 1\n1 0 0 0 0 1": "line 1: 6 values between blanks and no names .* whether .* is not guessed",
    "0 0 0\n1 2 three": "line 2: z = 'three', expected a number",
    "0 0 0\n1 2 1_000": "line 2: z = '1_000', expected a number",
    "0 0 0\n1 2 ٣": "line 2: z = '٣', expected a number",
    "0;0;0\n1,500;2;3": "line 2: is '1,500' a number with a decimal comma, or with a comma between thousands",
    "0;0.5;0\n1,5;2;3": "line 2: is '1,5' a number with a decimal comma",
    "0;0;0\n1,5,5;2;3": "line 2: x = '1,5,5', expected a number with .* decimal=','",
    "0,5 1,5 0": "line 1: y = '5 1', expected a number with a decimal point, or read the file with decimal=','",
    "0,0,0\n1,,3": "line 2: y = '', expected a number",
    "0 0 0\n1 nan 3": "line 2: y = nan, expected a finite number",
    "0 0 0\n-1e999 0 3": "line 2: x = -inf, expected a finite number",
    "0 0 0\n1e5 0 0": "line 2: further than 10000 m from the origin; is the unit right",
    "0 0 0\n1 1 1\n\n2 2 2\n2 2 2\n\n3 3 3": "line 4: the contour that begins here is one point",
    "x y z i j k\n0 0 0 0 0 1\n1 0 0 0 0 0": "line 3: the tool axis i j k is 0 0 0",
    "x y z qx qy qz qw\n0 0 0 0 0 0 1\n1 0 0 0 0 0 0": "line 3: the quaternion is 0 0 0 0",
    "x y z qx qy qz qw\n0 0 0 0 0 0 1\n1 0 0 0 0 0 2": "line 3: the quaternion qx qy qz qw has not the norm 1",
    "x y z i j k\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 0 0 0 1 1": "line 4: the tool axis turns on the spot",
}


@pytest.mark.parametrize("table", REFUSED)
def test_mistakes_are_found_by_their_line(table):
    with pytest.raises(ToolpathError, match=rf"\.csv: {REFUSED[table]}"):
        read(table)


def test_a_unit_must_not_contradict_the_file():
    with pytest.raises(ToolpathError, match="its columns are in 'mm', which unit = 'in' contradicts"):
        read("x_mm y_mm z_mm\n0 0 0\n1 1 1", unit="in")
    assert read("x_mm y_mm z_mm\n0 0 0\n1 1 1", unit="mm").unit == "mm"


@pytest.mark.parametrize(
    ("options", "name"), [({"unit": "ft"}, "unit"), ({"feed": 0}, "feed"), ({"feed": "fast"}, "feed")]
)
def test_wrong_arguments_are_named(options, name):
    with pytest.raises(InputError, match=name):
        read("0 0 0\n1 1 1", **options)


def test_files_that_are_none(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "nul").write_bytes(b"0 0 0\0")
    with (tmp_path / "large").open("wb") as large:
        large.truncate(1 << 30)
    (tmp_path / "long").write_bytes(b"0 0 0\n" + b"1" * 200_000)
    (tmp_path / "lines").write_bytes(b"\n" * 5_000_000)
    (tmp_path / "points").write_text("0 0 0\n1 1 1\n2 2 2\n")
    expected = {
        ".": "is no regular file, expected a table of points",
        "pipe": "is no regular file",
        "missing": "cannot be read, expected a table of points: No such file",
        "a\0b": "cannot be read",
        "n" * 300: "cannot be read",
        "nul": "holds NUL bytes and is no text",
        "large": "is larger than the 64 MiB that are read",
        "long": "line 2: 200000 characters, expected at most 100000",
        "lines": "has more than 4000000 lines",
    }
    for name, message in expected.items():
        with pytest.raises(ToolpathError, match=message):
            read_csv(tmp_path / name)
    monkeypatch.setattr("pathcontrol.toolpaths.csv.table.MAX_SEGMENTS", 2)
    with pytest.raises(ToolpathError, match="line 3: more than 2 points"):
        read_csv(tmp_path / "points")
    with pytest.raises(InputError, match="path = None, expected the path of a file"):
        text.read_text(None, "a file")
