"""Tables as other programs write them: columns, units and decimal marks are said by someone, never guessed."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import floats
from test_csv_toolpath import polylines, read, rows

from pathcontrol import InputError
from pathcontrol.errors import ToolpathError

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254}


def points(toolpath) -> np.ndarray:
    return toolpath[0].segments[0].points


# --- units --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", METRES)
@pytest.mark.parametrize(
    "head",
    [
        "# x [{0}], y [{0}], z [{0}]",
        "#X({0}),Y({0}),Z({0})",
        "# x_{0} y_{0} z_{0}",
        "# made by hand\n#  x [{0}] y [{0}] z [{0}]\n# last run",
        "# units: {0}",
        "# x y z\n# unit = {0}",
        "# x y z, units in {0}",
        "x,y,z\n[{0}],[{0}],[{0}]",
        "x,y,z\n{0},{0},{0}",
        "# x [{0}], y [{0}], z [{0}]\nx,y,z",
        '"X [{0}]","Y [{0}]","Z [{0}]"',
        "x ({0}), y ({0}), z ({0}),",
    ],
)
def test_the_unit_is_read_wherever_it_is_said(head, unit):
    toolpath = read(head.format(unit) + "\n0,0,0\n10,0,5\n")
    assert toolpath.unit == unit
    assert np.allclose(points(toolpath), np.array([[0, 0, 0], [10, 0, 5]]) * METRES[unit], rtol=1e-15)
    with pytest.raises(ToolpathError, match="contradicts"):
        read(head.format(unit) + "\n0,0,0\n10,0,5\n", unit="in" if unit != "in" else "m")


@given(polylines(), st.sampled_from([",", " ", ";"]))
def test_what_numpy_writes_is_read(values, delimiter):
    file = io.StringIO()
    np.savetxt(file, values, delimiter=delimiter, header=delimiter.join(f"{c} [mm]" for c in "xyz"), fmt="%.17g")
    assert np.allclose(points(read(file.getvalue())), values / 1e3, rtol=1e-15, atol=0)


def test_a_comment_that_sounds_like_a_unit_is_told():
    for comment in ("tool of 6 mm", "speeds of all points in mm/s", "exported in 3 mm steps"):
        toolpath = read(f"# {comment}\n0 0 0\n1 0 0")
        assert toolpath.unit == "m"
        (note,) = toolpath.notes
        assert note.startswith("line 1 speaks of 'mm', but the coordinates are taken for metres")
        assert not read(f"# {comment}\n0 0 0\n1 0 0", unit="mm").notes
    assert not read("# exported by a plugin\n0 0 0\n1 0 0").notes
    assert not read("# no word of it\n0 0 0\n1 0 0").notes


def test_a_comment_of_other_columns_names_none():
    with pytest.raises(ToolpathError, match="6 values between blanks and no names of columns"):
        read("# x y z\n0 0 0 1 2 3\n1 0 0 1 2 3")
    toolpath = read("# time x y z\n0 1 2 3\n1 4 5 6")
    assert np.array_equal(points(toolpath), [[1, 2, 3], [4, 5, 6]])
    assert toolpath.notes == ("column 'time' is passed over",)


# --- columns ------------------------------------------------------------------------------------------------


@given(polylines(), st.permutations(range(7)), st.booleans())
def test_columns_are_found_by_their_names_and_others_passed_over(values, order, by_name):
    names = ["x", "y", "z", "nx", "ny", "nz", "speed"]
    table = np.column_stack([values, np.tile([0.0, 3, 4], (len(values), 1)), np.full(len(values), 7.0)])[:, order]
    said = [names[k] for k in order]
    toolpath = read(
        (",".join(said) + "\n" if by_name else "") + rows(table, ","), **({} if by_name else {"columns": said})
    )
    assert np.array_equal(points(toolpath), values)
    assert np.allclose(toolpath[0].normals, [0, 0.6, 0.8])
    assert toolpath.notes == ("column 'speed' is passed over",)


WRITTEN = "N;Pos X [mm];Höhe [mm];Part;y (mm)\n1;10;0.5;a;0\n2;20;0.5;a;0\n3;30;0.5;b;1\n4;40;0.5;b;2\n"


@pytest.mark.parametrize(
    "columns",
    [
        ["_", "x", "z", "contour", "y"],
        ("N", "x", "z", "contour", "y"),
        "_,x,z,contour,y",
        "_ x z contour y",
        {"x": 1, "y": 4, "z": 2, "contour": 3},
        {"x": "Pos X", "Y": "y (mm)", "z": "höhe", "contour": "PART"},
        {"x": "pos x [mm]", "y": "y", "z": 2, "contour": "Part"},
        "x=1, y=y, z=Höhe, contour=3",
    ],
)
def test_columns_may_be_chosen_by_order_number_or_name(columns):
    toolpath = read(WRITTEN, columns=columns)
    assert [c.name for c in toolpath] == ["a", "b"]
    assert np.allclose(toolpath[1].segments[0].points, [[0.03, 0.001, 0.0005], [0.04, 0.002, 0.0005]])


@pytest.mark.parametrize(
    ("columns", "error", "message"),
    [
        (5, InputError, "columns = 5, expected names in the order of the file"),
        ([0, 1, 2], InputError, "columns = "),
        ({"a": 0}, InputError, "names are x, y, z, i, j, k, qx"),
        ({"x": 1.5}, InputError, "columns = "),
        ({"x": True}, InputError, "columns = "),
        ([], InputError, "columns = "),
        ("", InputError, "columns = "),
        ({"x": 0, "y": 1, "z": 7}, ToolpathError, "names column 7, the file has the columns 0 to 3"),
        ({"x": 0, "y": 1, "z": -1}, ToolpathError, "names column -1, the file has"),
        ({"x": 0, "y": 1, "z": "height"}, ToolpathError, "names a column 'height', the file has none that have names"),
        (["x", "y", "z", "i", "j"], ToolpathError, "names 5 columns, the file has 4"),
        (["x", "y", "y", "z"], ToolpathError, "each once"),
        (["x", "y"], ToolpathError, "expected z too; a table of x and y alone needs z="),
    ],
)
def test_wrong_choices_are_refused(columns, error, message):
    with pytest.raises(error, match=message):
        read("0 0 0 0\n1 0 0 0", columns=columns)


def test_what_is_not_a_normal_is_passed_over_when_the_caller_says_so():
    toolpath = read("0,0,0,180,0,0\n1,0,0,180,0,0", columns=["x", "y", "z", "roll", "pitch", "yaw"])
    assert toolpath[0].normals is None
    (note,) = toolpath.notes
    assert note.startswith("columns 'roll', 'pitch', 'yaw' are passed over: of angles nothing is read")
    assert read("0,0,0,255,9,0\n1,0,0,255,9,0", columns="x,y,z,_,_,_").notes == (
        "columns '3', '4', '5' are passed over",
    )


@pytest.mark.parametrize("names", ["roll,pitch,yaw", "rx,ry,rz", "A,B,C", "W,P,R", "roll [deg],pitch [deg],yaw [deg]"])
def test_angles_are_said_to_be_unread(names):
    assert "of angles nothing is read" in read(f"x,y,z,{names}\n0,0,0,1,2,3\n1,0,0,1,2,3").notes[0]
    assert "angles" not in read("x,y,z,r,g,b\n0,0,0,1,2,3\n1,0,0,1,2,3").notes[0]


UNITS_SAID = {"mm": "mm", "millimetres": "mm", "inch": "in", "inches": "in", "centimeter": "cm", "microns": "um"}


@pytest.mark.parametrize("unit", UNITS_SAID)
def test_a_unit_is_heeded_wherever_it_is_said(unit):
    metres = {"mm": 1e-3, "in": 25.4e-3, "cm": 1e-2, "um": 1e-6}[UNITS_SAID[unit]]
    heads = [f"# {unit}", f"# x y z in {unit}", f"# x, y, z in {unit}", f"# all lengths are in {unit}", f"# ({unit})"]
    heads += [f"# coordinates in {unit}", ",".join(f"{c} / {unit}" for c in "xyz")]
    heads += [",".join(name.format(c) for c in "XYZ") for name in (f"{{}} in {unit}", f"{{}} Position ({unit})")]
    for head in heads:
        assert np.allclose(points(read(head + "\n0,0,0\n10,0,5\n")), np.array([[0, 0, 0], [10, 0, 5]]) * metres)


@pytest.mark.parametrize("name", ["{}_pos", "{} Position", "{}-coord", "{}coordinate"])
def test_names_that_begin_with_the_letter(name):
    head = ",".join(name.format(c) for c in "zxy")
    assert np.array_equal(points(read(head + "\n3,1,2\n6,4,5")), [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("name", ["pose.position.{}", "field.pose.position.{}", "pos_{}", "Position {}", "pos{}"])
def test_names_of_other_programs(name):
    head = ",".join(["%time", *(name.format(c) for c in "xyz"), *(f"pose.orientation.{c}" for c in "xyzw")])
    toolpath = read(head + "\n9,1,2,3,0,0,0,1\n9,4,5,6,0,0,0,1")
    assert np.array_equal(points(toolpath), [[1, 2, 3], [4, 5, 6]])
    assert np.allclose(toolpath[0].normals, [0, 0, -1])


@given(polylines(), st.integers(0, 999), floats(0.995, 1.005))
def test_quaternions_are_those_of_ros(values, seed, norm):
    """The tool's z axis points against the axis that is kept; SciPy's order is ROS's, w last."""
    turns = Rotation.random(len(values), rng=np.random.default_rng(seed))
    table = np.hstack([turns.as_quat() * norm, values])
    toolpath = read("qx,qy,qz,qw,x,y,z\n" + rows(table, ","))
    assert np.allclose(toolpath[0].normals, -turns.as_matrix()[:, :, 2], atol=1e-9)
    assert any("qx qy qz qw" in note for note in toolpath.notes)


# --- numbers ------------------------------------------------------------------------------------------------


@given(polylines(), st.sampled_from([";", "\t", "; "]), st.booleans(), st.booleans(), st.sampled_from(["", ";", ";;"]))
def test_german_numbers(values, separator, quoted, named, end):
    """Decimal commas are found out where nothing else can be meant, or said."""
    table = np.round(np.round(values, 3) + 0.00025, 5)  # five decimals, which no thousands have
    lines = [separator.join(f'"{v:.5f}"' if quoted else f"{v:.5f}" for v in row).replace(".", ",") for row in table]
    text = ("X;Y;Z\n".replace(";", separator) if named else "") + "\r\n".join(line + end.strip() for line in lines)
    if end and separator == "\t":
        text = text.replace(";", "\t")
    found = read(text)
    assert np.allclose(points(found), table, rtol=1e-12, atol=0)
    assert found.notes == ("the numbers have a decimal comma",)
    said = read(text, decimal=",")
    assert np.array_equal(points(said), points(found))
    assert not said.notes


def test_decimal_marks_that_are_said():
    assert np.array_equal(points(read("1,500;0;0\n2,500;0;0", decimal=",")), [[1.5, 0, 0], [2.5, 0, 0]])
    assert np.array_equal(points(read("1,5 0 0\n2,5 0 0", decimal=",")), [[1.5, 0, 0], [2.5, 0, 0]])
    assert np.array_equal(points(read('"1,5","0","0"\n"2,5","0","0"', decimal=",")), [[1.5, 0, 0], [2.5, 0, 0]])
    for table, message in {
        "1.5;0;0\n2,5;0;0": "line 1: x = '1.5', expected a number with a decimal comma",
        "1,5;0;0\n1.234,5;0;0": r"line 2: x = '1\.234,5', expected a number with a decimal comma",
    }.items():
        with pytest.raises(ToolpathError, match=message):
            read(table, decimal=",")
    with pytest.raises(ToolpathError, match=r"line 1: x = '1,5', expected a number with a decimal point"):
        read("1,5;0;0\n2,5;0;0", decimal=".")
    with pytest.raises(InputError, match="decimal = ';', expected one of"):
        read("0 0 0\n1 0 0", decimal=";")


@pytest.mark.parametrize(
    "table",
    [
        "x,y,z,\n0,0,0,\n1,2,3,\n",
        "x,y,z\n0,0,0,\n1,2,3,,\n",
        "0,0,0,\n1,2,3,\n",
        "x;y;z;;\n0;0;0;;\n1;2;3;;\n",
        "sep=;\nx;y;z\n0;0;0\n1;2;3\n",
        'sep=,\n"x","y","z"\n"0","0","0"\n"1","2","3"\n',
        '"x" "y" "z"\n0 0 "0"\n"1" 2 3\n',
        "x\ty\tz\t\n0\t0\t0\t\n1\t2\t3\t\n",
        ",,,\nx,y,z\n0,0,0\n1,2,3\n,,,\n,,\n",
        "﻿x,y,z\r\n0,0,0\r\n1,2,3\r\n",
    ],
)
def test_spreadsheets_are_read(table):
    toolpath = read(table)
    assert len(toolpath) == 1
    assert np.array_equal(points(toolpath), [[0, 0, 0], [1, 2, 3]])


def test_quoted_names_of_contours_may_hold_anything():
    toolpath = read('contour,x,y,z\n"a, b # c",0,0,0 # first\n"a, b # c",1,0,0\n"d ""e""",2,0,0\n"d ""e""",3,0,0')
    assert [c.name for c in toolpath] == ["a, b # c", 'd "e"']


# --- z ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("head", ["", "x [mm],y [mm]\n", "# y x\n", "x,y,speed\n"])
def test_plane_tables_take_their_height_in_metres(head):
    lines = ["1,2", "3,4"]
    toolpath = read(head + "\n".join(f"{line},9" if "speed" in head else line for line in lines), z=0.25)
    scale = 1e-3 if "mm" in head else 1
    expected = np.array([[1, 2], [3, 4]])[:, :: -1 if "y x" in head else 1] * scale
    assert np.allclose(points(toolpath), np.column_stack([expected, [0.25, 0.25]]))


def test_a_height_is_given_once():
    with pytest.raises(ToolpathError, match="expected no z where z= is given"):
        read("x,y,z\n0,0,0\n1,0,0", z=0.1)
    with pytest.raises(ToolpathError, match=r"3 values between commas and no names of columns, expected 2 \(x y\)"):
        read("0,0,0\n1,0,0", z=0.1)
    with pytest.raises(ToolpathError, match="x y alone need z=, their height in metres"):
        read("0,0\n1,0")
    with pytest.raises(InputError, match="z = "):
        read("0,0\n1,0", z=np.inf)
