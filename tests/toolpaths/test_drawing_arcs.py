"""Arcs and ellipses of DXF whose ends are nearly a whole turn apart, and those that only seem to be."""

from __future__ import annotations

import ezdxf
import numpy as np
import pytest
from drawings import TOGETHER, apart, dxf_reader
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.dxf.reader import read_dxf
from pathcontrol.toolpaths.segments.arc import Arc

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return dxf_reader(tmp_path_factory.mktemp("dxf"))


def whole(contour) -> bool:
    (segment,) = contour.segments
    return contour.closed and isinstance(segment, Arc) and abs(segment.sweep) == pytest.approx(TURN, abs=1e-12)


def test_an_arc_within_1e_4_of_a_whole_turn_is_one(read):
    ends = [
        *[(0, 360), (0, 360.0001), (0, 359.9999), (90, 450.0001), (270, 270), (270.0001, 270), (-90, 269.9999)],
        *[(0, 720), (90, 90.00005), (360, 0), (1e-9, 0), (0, 359.9999999), (180, -180), (180, -180.0001)],
    ]
    found = read(apart(lambda m, a=start, b=end: m.add_arc((1, 2), 0.01, a, b) for start, end in ends))
    for contour, pair in zip(found, ends, strict=True):
        assert whole(contour), pair
        assert contour.length == pytest.approx(TURN * 0.01, rel=1e-12), pair


@settings(TOGETHER, max_examples=1 + TOGETHER.max_examples)  # the first list that is tried is all zeros
@given(st.lists(st.tuples(st.floats(-TURN, 2 * TURN), st.floats(-1e-4, 1e-4), st.integers(1, 2)), min_size=10))
def test_an_ellipse_within_1e_4_of_a_whole_turn_is_one(read, ellipses):
    ends = [(start, start + turns * TURN + 0.99 * off) for start, off, turns in ellipses]
    found = read(apart(lambda m, a=a, b=b: m.add_ellipse((1, 2), (0.02, 0.01), 0.4, a, b) for a, b in ends))
    assert [whole(contour) for contour in found] == [True] * len(ends)


@pytest.mark.parametrize("end", [6.28318530718, 6.2831855, 6.283185, 6.2832])
def test_ellipses_as_programs_write_them(read, end):
    (contour,) = read(lambda m: m.add_ellipse((0, 0), (0.05, 0), 0.5, 0, end))
    assert whole(contour)


@settings(TOGETHER, max_examples=1 + TOGETHER.max_examples)  # the first list that is tried is all zeros
@given(st.lists(st.tuples(st.floats(-400, 400), st.floats(-4.9, -2).map(lambda e: 10**e)), min_size=10))
def test_short_arcs_and_arcs_with_a_gap_stay_what_they_are(read, arcs):
    """Not near a whole turn by more than 1e-4 rad, or short without having been reduced by a turn."""
    gaps = [(start, sweep) for start, sweep in arcs if sweep > 1.01e-4]
    ends = [(start, start + float(np.rad2deg(sweep))) for start, sweep in arcs]
    ends += [(start, start - float(np.rad2deg(sweep))) for start, sweep in gaps]
    found = read(apart(lambda m, a=a, b=b: m.add_arc((0, 0), 1, a, b) for a, b in ends))
    assert [c.length for c in found[: len(arcs)]] == pytest.approx([sweep for _, sweep in arcs], rel=1e-6)
    assert [c.length for c in found[len(arcs) :]] == pytest.approx([TURN - sweep for _, sweep in gaps])
    assert not any(c.closed for c in found[len(arcs) :])


def test_a_bulge_of_nearly_a_whole_turn_is_drawn(read):
    """tan(Δφ/4) of 2π − 1e-4 over the chord that belongs to it."""
    sweep, radius = TURN - 1e-4, 0.01
    ends = [(radius, 0), (radius * np.cos(1e-4), -radius * np.sin(1e-4))]
    bulges = [(*ends[0], np.tan(sweep / 4)), (*ends[1], 0)]
    (contour,) = read(lambda m: m.add_lwpolyline(bulges, format="xyb"))
    assert contour.length == pytest.approx(radius * sweep, rel=1e-6)


FIT = "0\nSPLINE\n8\n0\n100\nAcDbEntity\n100\nAcDbSpline\n70\n8\n71\n3\n72\n0\n73\n0\n74\n3\n"


@pytest.mark.parametrize("values", ["-1e+308", "1e308", "1e200", "-1e20"])
def test_fit_points_that_are_far_away_are_refused_with_the_name_of_the_spline(tmp_path, values):
    points = "".join(f"11\n{x}\n21\n{y}\n31\n{z}\n" for x, y, z in ((0, 0, 0), (1, 2, values), (3, 3, 0)))
    path = tmp_path / "drawing.dxf"
    path.write_text(f"0\nSECTION\n2\nENTITIES\n{FIT}{points}0\nENDSEC\n0\nEOF\n")
    with pytest.raises(ValueError, match=r"drawing\.dxf.*SPLINE"):
        read_dxf(path, unit="mm")


@pytest.mark.parametrize("old", ["Model", "*Model_Space", "AcDbLayout", "LAYER", "*Paper_Space"])
def test_drawings_with_a_part_renamed_are_read_or_refused_with_their_name(tmp_path, old):
    document = ezdxf.new("R2010", units=4)
    document.modelspace().add_line((0, 0), (1, 1))
    document.saveas(tmp_path / "whole.dxf")
    text = (tmp_path / "whole.dxf").read_text()
    path = tmp_path / "renamed.dxf"
    for count in range(1, 4):
        path.write_text(text.replace(f"\n{old}\n", "\nelse\n", count))
        refused = None
        try:
            assert len(read_dxf(path)) == 1
        except ToolpathError as error:
            refused = str(error)
        assert refused is None or "renamed.dxf" in refused


@pytest.mark.parametrize("degrees", [1e-3, 4e-3, 0.02])
@pytest.mark.parametrize("radius", [1e-3, 1e-2, 1.0])
def test_an_arc_as_short_as_a_gap_is_no_closed_contour(read, radius, degrees):
    (contour,) = (toolpath := read(lambda m: m.add_arc((1, 2), radius, 30, 30 + degrees))).contours
    assert not contour.closed
    assert contour.length == pytest.approx(radius * np.radians(degrees), rel=1e-6)
    assert toolpath.notes == ()  # and none of a gap between its own ends


def test_a_gap_in_an_arc_is_told(read):
    toolpath = read(lambda m: m.add_arc((1, 2), 0.01, 0, 359.9))
    assert "1 gap between ends of contours, of up to 17.5 µm, stays open" in toolpath.notes[0]
