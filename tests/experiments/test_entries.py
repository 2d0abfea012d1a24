"""What a program cuts without lifting is cut so, from where it begins; rapids end where the program's do."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import Contour, RobotModel, Toolpath, ToolpathTask, load_robot, read_gcode, smooth
from pathcontrol.cartesian.contour_links import link_contours
from pathcontrol.toolpaths.gcode.strokes import ContourBuilder
from pathcontrol.toolpaths.segments.segment import Polyline

UP, TOLERANCE, CLEARANCE = np.array([0.0, 0.0, 1.0]), 1e-4, 0.01
SURFACE = 0.0  # m, the top of the stock
CORNERS = st.sampled_from(["blend", "stop"])

PLUNGE_AT_CORNER = """G21 G90 G17
G0 X0 Y0 Z5
G1 Z-1 F900
G1 X40 Y0 F1800
G3 X40 Y20 I0 J10
G1 X10
G3 X0 Y10 I0 J-10
G1 X0 Y0
G0 Z5
G0 X15 Y10
G1 Z-1 F900
G2 X15 Y10 Z-2 I5 J0 F1200
G0 Z5
M30
"""


@st.composite
def programs(draw: st.DrawFn) -> str:
    """Plunges, cuts, full turns, ways back to the entry, retracts and rapids in any order, with feeds that change."""
    x, y = draw(places), draw(places)
    lines, deep, entry = [f"G0 X{x} Y{y} Z5"], False, (x, y)
    for _ in range(draw(st.integers(1, 12))):
        if not deep:
            if draw(st.booleans()):
                x, y = draw(places), draw(places)
                lines.append(f"G0 X{x} Y{y}")
            lines.append(draw(st.sampled_from(["G1 Z-1 F300", "G1 Z-2.5 F900", "G0 Z-0.5"])))
            deep, entry = True, (x, y)
            continue
        step = draw(st.sampled_from(["cut", "cut", "cut", "cut", "turn", "back", "back", "lift", "sink", "slide"]))
        if step in ("cut", "slide"):
            x, y = draw(places), draw(places)
            lines.append(f"G{int(step == 'cut')} X{x} Y{y}" + (draw(feeds) if step == "cut" else ""))
        elif step == "turn":
            code, center = draw(st.sampled_from([2, 3])), draw(st.sampled_from([-7, 3, 5]))
            lines.append(f"G{code} X{x} Y{y} I{center} J0" + draw(feeds))
        elif step == "back":
            x, y = entry
            lines.append(f"G1 X{x} Y{y}" + draw(feeds))
            if draw(st.booleans()):
                lines.append("G0 Z5")
                deep = False
        elif step == "sink":
            lines.append("G1 Z-3 F300")
        else:
            lines.append(draw(st.sampled_from(["G0 Z5", "G1 Z2 F900", "G0 Z0.05"])))
            deep = False
    return "G21 G90 G17 F500\n" + "\n".join([*lines, "G0 Z5", "M30"]) + "\n"


places, feeds = st.integers(-3, 3).map(lambda i: 10 * i), st.sampled_from(["", "", "", " F600", " F1200"])


def read(text: str, folder) -> Toolpath:
    (folder / "program.ngc").write_text(text)
    return read_gcode(folder / "program.ngc")


def ends(smoothed) -> np.ndarray:
    """First and last points [m] of its curves, (curves, 2, 3)."""
    return np.array([[curve.position(curve.s0), curve.position(curve.s_end)] for curve in smoothed.curves])


def assert_as_programmed(toolpath: Toolpath, corner: str) -> None:
    whole = link_contours(toolpath.contours, CLEARANCE, UP, TOLERANCE, corner)
    # nothing is put in: the tool is lifted where the program lifts it, and nowhere else
    assert [contour for contour, _ in whole] == list(toolpath.contours)
    tracks = [ends(smoothed) for _, smoothed in whole]
    for contour, track in zip(toolpath, tracks, strict=True):
        assert np.abs(track[0, 0] - contour.start).max() < 1e-9
        assert np.abs(track[-1, 1] - contour.end).max() < 1e-9
    chained = np.concatenate(tracks)
    assert np.abs(chained[1:, 0] - chained[:-1, 1]).max(initial=0.0) < 1e-9
    for contour, smoothed in whole:
        for curve in smoothed.curves:
            x = curve.position(np.linspace(curve.s0, curve.s_end, 200))
            assert contour.distance(x).max() <= TOLERANCE * 1.001
    # what rapids pass below the surface, the program passes too
    for contour, smoothed in whole:
        if contour.rapid:
            x = np.concatenate([c.position(np.linspace(c.s0, c.s_end, 200)) for c in smoothed.curves])
            below = x[x[:, 2] < SURFACE - TOLERANCE]
            assert below.size == 0 or contour.distance(below).max() <= TOLERANCE * 1.001


def test_a_plunge_at_a_corner_is_followed_by_the_cut_that_begins_there(tmp_path):
    assert_as_programmed(read(PLUNGE_AT_CORNER, tmp_path), "blend")


@given(text=programs(), corner=CORNERS)
def test_random_programs_are_followed_as_they_lift_and_plunge(text, corner, tmp_path_factory):
    assert_as_programmed(read(text, tmp_path_factory.mktemp("program")), corner)


@given(
    corners=st.lists(st.tuples(places, places), min_size=3, max_size=6, unique=True),
    lead=st.floats(0.05, 0.95),
    corner=CORNERS,
)
def test_a_lead_in_in_the_middle_of_an_edge_is_kept(corners, lead, corner):
    """A closed contour begins where it begins, whether it is blended, stopped at its corners or turns back."""
    points = 1e-3 * np.array([(x, y, 0) for x, y in corners], dtype=float)
    entry = (1 - lead) * points[0] + lead * points[1]
    round_trip = np.array([entry, *points[1:], points[0], entry])
    contour = Contour((Polyline(round_trip),), closed=True, feed=0.01)
    track = ends(link_contours([contour], CLEARANCE, UP, TOLERANCE, corner)[0][1])
    assert np.abs(track[[0, -1], [0, 1]] - entry).max() < 1e-12
    smoothed = smooth(contour, TOLERANCE, corner)
    assert np.abs(ends(smoothed)[0, 0] - entry).max() < 1e-12


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), corner=CORNERS)
def test_between_the_contours_of_a_drawing_rapids_end_where_the_drawing_begins(seed, corner):
    rng, contours = np.random.default_rng(seed), []
    for _ in range(rng.integers(2, 5)):
        builder = ContourBuilder(np.append(rng.uniform(-0.1, 0.1, 2), 0.0))
        for _ in range(rng.integers(2, 6)):
            builder.line_to(np.append(rng.uniform(-0.1, 0.1, 2), 0.0))
        builder.close()
        contours.append(builder.contour(feed=0.01))
    whole = link_contours(contours, CLEARANCE, UP, TOLERANCE, corner)
    for (before, track), (after, following) in itertools.pairwise((c, ends(s)) for c, s in whole):
        assert np.abs(track[-1, 1] - following[0, 0]).max() < 1e-9
        if before.rapid:
            assert np.abs(track[-1, 1] - after.start).max() < 1e-9


@cache
def gantry() -> RobotModel:
    """An arm whose joints are the coordinates of its tool."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    parts = ['<link name="base"/>']
    for parent, child, axis in (("base", "x", "1 0 0"), ("x", "y", "0 1 0"), ("y", "z", "0 0 1")):
        parts.append(f"""<link name="{child}">{body}<joint name="to_{child}" type="prismatic"><parent link="{parent}"/>
          <child link="{child}"/><axis xyz="{axis}"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>""")
    return load_robot(f'<robot name="gantry">{"".join(parts)}</robot>')


@pytest.mark.parametrize("corner", ["blend", "stop"])
def test_the_paths_of_an_arm_do_so_too(corner, tmp_path):
    toolpath = read(PLUNGE_AT_CORNER, tmp_path)
    task = ToolpathTask(gantry(), "z", toolpath, corner=corner)
    assert [c.rapid for c, _ in itertools.groupby(task.contours)] == [c.rapid for c in toolpath]
    for contour, group in itertools.groupby(zip(task.contours, task.paths, strict=True), lambda pair: pair[0]):
        paths = [path for _, path in group]
        assert np.abs(paths[0].q_d(np.array(paths[0].s0)) - contour.start).max() < 1e-5
        assert np.abs(paths[-1].q_d(np.array(paths[-1].s_end)) - contour.end).max() < 1e-5
