"""Arcs of G-code against rotations about the axis that the plane is normal to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import floats, vectors
from test_gcode import HEAD, read, same

from pathcontrol.errors import ToolpathError

AXES = {"G17": np.array([0.0, 0, 1]), "G18": np.array([0.0, 1, 0]), "G19": np.array([1.0, 0, 0])}


def words(letters: str, values: np.ndarray) -> str:
    return " ".join(f"{letter}{value:.12f}" for letter, value in zip(letters, values, strict=True))


@st.composite
def arcs(draw: st.DrawFn, least: float = 0.05, most: float = 2 * np.pi - 0.05):
    """Plane, whether clockwise, centre, start, angle turned and rise, in millimetres, and points along the arc."""
    plane = draw(st.sampled_from(list(AXES)))
    axis = AXES[plane]
    clockwise, turned = draw(st.booleans()), draw(floats(least, most))
    start, spoke, rise = draw(vectors(3, 50.0)), draw(vectors(3, 30.0)), draw(floats(-20, 20))
    spoke = np.where(axis == 1, 0.0, spoke)  # to the centre
    assume(np.linalg.norm(spoke) > 0.5)
    angles = np.linspace(0, -turned if clockwise else turned, 9)
    points = start + spoke - Rotation.from_rotvec(angles[:, None] * axis).apply(spoke)
    points += np.linspace(0, rise, 9)[:, None] * axis
    return plane, clockwise, spoke, points


def program(plane: str, clockwise: bool, points: np.ndarray, centre: str, preamble: str = "") -> str:
    place = f"G21 G90 {preamble}\nG0 {words('XYZ', points[0])}\n{plane} F600\n"
    return place + f"G{2 if clockwise else 3} {words('XYZ', points[-1])} {centre}"


def offsets(plane: str, values: np.ndarray) -> str:
    letters = "IJK".replace("IJK"[int(np.argmax(AXES[plane]))], "")
    return words(letters, values[AXES[plane] == 0])


@given(arcs())
def test_arcs_turn_about_the_planes_axis(case):
    """Clockwise means seen from the positive end of the axis, in the plane XZ too: NIST RS274/NGC, 3.5.3."""
    plane, clockwise, spoke, points = case
    (contour,) = read(program(plane, clockwise, points, offsets(plane, spoke)))
    (segment,) = contour.segments
    assert np.allclose(segment.point(np.linspace(0, 1, 9)), points / 1e3, rtol=0, atol=1e-11)
    assert contour.feed == pytest.approx(0.01)


@given(arcs(most=np.pi - 0.05) | arcs(least=np.pi + 0.05))
def test_a_radius_says_the_same_as_a_centre(case):
    """R > 0 is the shorter way about, R < 0 the longer."""
    plane, clockwise, spoke, points = case
    (by_centre,) = read(program(plane, clockwise, points, offsets(plane, spoke)))
    longer = abs(by_centre.segments[0].sweep) > np.pi
    radius = (-1 if longer else 1) * np.linalg.norm(spoke)
    (by_radius,) = read(program(plane, clockwise, points, f"R{radius:.12f}"))
    u = np.linspace(0, 1, 9)
    assert np.allclose(by_radius.segments[0].point(u), by_centre.segments[0].point(u), rtol=0, atol=1e-9)


@given(arcs())
def test_centres_may_be_absolute(case):
    plane, clockwise, spoke, points = case
    absolute = program(plane, clockwise, points, offsets(plane, points[0] + spoke), "G90.1")
    same(read(absolute), read(program(plane, clockwise, points, offsets(plane, spoke))), atol=1e-11)


@given(arcs())
def test_back_is_the_same_arc_the_other_way(case):
    plane, clockwise, spoke, points = case
    there = read(program(plane, clockwise, points, offsets(plane, spoke)))[0]
    home = points[0] + spoke - points[-1]
    back = read(program(plane, not clockwise, points[::-1], offsets(plane, home)))[0].reversed()
    u = np.linspace(0, 1, 9)
    assert np.allclose(there.segments[0].point(u), back.segments[0].point(u), rtol=0, atol=1e-10)


@given(arcs(), st.integers(3, 5))  # with two digits some are farther apart than is accepted
def test_rounded_arcs_meet_their_ends_and_stay_as_near_as_they_are_rounded(case, digits):
    plane, clockwise, spoke, points = case
    assume(np.linalg.norm(points[-1] - points[0]) > 0.5)
    exact = np.round(points[[0, -1]], digits) / 1e3
    text = program(plane, clockwise, np.round(points, digits), offsets(plane, np.round(spoke, digits)))
    (contour,) = read(text + "\nG1 X0 Y0 Z0")
    assert np.allclose(contour.segments[0].point(np.array([0.0, 1.0])), exact, rtol=0, atol=1e-12)
    away = np.linalg.norm(contour.segments[0].point(np.linspace(0, 1, 9)) - points / 1e3, axis=-1)
    # by at most 0.87 units at each end, 1.6 at the centre, and what that turns and stretches the arc by
    assert away.max() < 10 * 10.0**-digits / 1e3


@given(st.sampled_from(list(AXES)), st.booleans(), floats(0.1, 50), floats(0.1, 9))
def test_full_circles_and_helices_have_the_length_that_they_must(plane, clockwise, radius, rise):
    points = np.array([np.ones(3), np.ones(3) + rise * AXES[plane]])
    first = next(letter for letter, on in zip("IJK", AXES[plane], strict=True) if not on)
    (helix,) = read(program(plane, clockwise, points, f"{first}{radius:.12f}"))
    assert helix.length == pytest.approx(np.hypot(2 * np.pi * radius, rise) / 1e3, rel=1e-9)
    assert not helix.closed
    (circle,) = read(program(plane, clockwise, points[[0, 0]], f"{first}{radius:.12f}"))
    assert circle.closed
    assert np.allclose(circle.segments[0].sweep, -2 * np.pi if clockwise else 2 * np.pi)


def test_a_circle_needs_no_axis_and_a_helix_only_its_own():
    circle, helix = (read(HEAD + f"F60\nG3 J2 {word}")[0] for word in ("", "Z-1"))
    assert circle.length == pytest.approx(4e-3 * np.pi)
    assert helix.length == pytest.approx(np.hypot(4 * np.pi, 1) / 1e3)


def test_radii_may_differ_as_much_as_linuxcnc_allows():
    """By 0.005 mm, or 0.1 % of the radius up to 0.5 mm, and by 0.0005 in with G20."""

    def mismatch(radius: float, error: float, unit: str = "G21") -> str:
        return HEAD.replace("G21", unit) + f"F60\nG3 X{2 * radius + error:.5f} Y0 I{radius}"

    for radius, error in [(1, 0.0049), (100, 0.099), (1000, 0.499)]:
        assert read(mismatch(radius, error))
    assert read(mismatch(0.1, 0.00049, "G20"))
    for radius, error, unit in [(1, 0.0051, "mm"), (100, 0.102, "mm"), (1000, 0.501, "mm"), (0.1, 0.00051, "in")]:
        with pytest.raises(ToolpathError, match=f"line 4: the arc's radius is {radius} {unit} at its start and"):
            read(mismatch(radius, error, "G20" if unit == "in" else "G21"))


def test_a_chord_a_little_longer_than_the_diameter_is_a_semicircle():
    (contour,) = read(HEAD + "F60\nG2 X10.001 R5")
    assert contour.length == pytest.approx(np.pi * 5.0005e-3)


@pytest.mark.parametrize(
    ("arc", "message"),
    [
        ("G2 X1 Y1", "the plane of G17 with no centre, expected I or J, or R, in the line of each arc"),
        ("G2 X1 Y1 K1", "the plane of G17 with K, expected I or J"),
        ("G18 G2 X1 Z1 I1 J1", "J1 leads out of the plane of G18"),
        ("G19 G2 I1", "the plane of G19 with I, expected J or K"),
        ("G90.1 G2 X1 I1", "expected I and J, or R"),
        ("G2 X1 I1 R1", "with R and with I, J or K"),
        ("G2 R5", "ends in the plane where it begins; write a full circle with its centre"),
        ("G2 Z1 R5", "ends in the plane where it begins"),
        ("G2 X10 R4.99", "radius 4.99 mm between points 10 mm apart, expected a radius of at least half of that"),
        ("G2 X10 R0", "radius 0 mm"),
        ("G2 I0 J0", "the arc's centre is its start or its end"),
        ("G2 X1 I1", "the arc's centre is its start or its end"),
        ("G2 X2 I1.1", "radius is 1.1 mm at its start and 0.9 mm at its end"),
        ("G2 X0.002 Y0.002 R99999999", "the arc's centre is further than 10000 m"),
        ("G2 X1 R" + "9" * 400, "the arc's centre is further than 10000 m"),
        ("G2 X1 I" + "9" * 400, "the arc's centre is further than 10000 m"),
    ],
)
def test_arcs_that_do_not_exist_are_refused_by_their_line(arc, message):
    with pytest.raises(ToolpathError, match=f"line 4: .*{message}"):
        read(HEAD + "F60\n" + arc)


def test_a_centre_does_not_stay_in_force():
    with pytest.raises(ToolpathError, match=r"line 5: .*no centre"):
        read(HEAD + "F60\nG2 X2 I1\nX4")
