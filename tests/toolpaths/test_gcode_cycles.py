"""Drilling cycles are the moves that they stand for, written out one by one; turns and rounded ends of arcs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import floats
from test_gcode import HEAD, read, same

from pathcontrol.errors import ToolpathError

START = "G21 G90 F100\nG0 X0 Y0 Z10\n"
#: cycles, and the same written out as LinuxCNC documents them
WRITTEN_OUT = {
    "G98 G81 X5 Y6 Z-3 R2": "G0 X5 Y6\nZ2\nG1 Z-3\nG0 Z10",
    "G99 G81 X5 Y6 Z-3 R2\nX7\nG0 X0": "G0 X5 Y6\nZ2\nG1 Z-3\nG0 Z2\nX7\nG1 Z-3\nG0 Z2\nX0",
    "G81 Z-3 R2": "G0 Z2\nG1 Z-3\nG0 Z10",
    "G82 X5 Z-3 R2 P0.5\nY4 P1": "G0 X5\nZ2\nG1 Z-3\nG0 Z10\nY4\nZ2\nG1 Z-3\nG0 Z10",
    "G83 X5 Z-3 R2 Q2": "G0 X5\nZ2\nG1 Z0\nG0 Z10\nZ.254\nG1 Z-2\nG0 Z10\nZ-1.746\nG1 Z-3\nG0 Z10",
    "G99 G83 X5 Z-3 R2 Q4": "G0 X5\nZ2\nG1 Z-2\nG0 Z2\nZ-1.746\nG1 Z-3\nG0 Z2",
    "G73 X5 Z-3 R2 Q4": "G0 X5\nZ2\nG1 Z-2\nG0 Z-1.746\nG1 Z-3\nG0 Z10",
    "G83 X5 Z-3 R2 Q9": "G0 X5\nZ2\nG1 Z-3\nG0 Z10",
    "G91 G81 X4 Y1 R-8 Z-5 L2": "G0 X4 Y1\nZ2\nG1 Z-3\nG0 Z10\nX8 Y2\nZ2\nG1 Z-3\nG0 Z10",
    "G91 G99 G81 X4 R-8 Z-5 L3 ": "G0 X4\nZ2\nG1 Z-3\nG0 Z2\nX8\nG1 Z-3\nG0 Z2\nX12\nG1 Z-3\nG0 Z2",
    "G81 X5 Z-3 R2 L2": "G0 X5\nZ2\nG1 Z-3\nG0 Z10\nZ2\nG1 Z-3\nG0 Z10",
    "Z1\nG81 X5 Z-3 R2": "Z1\nG0 Z2\nX5\nG1 Z-3\nG0 Z2",
    "G99 G81 X5 Z-3 R2\nG98 X6\nG80 G0 X7": "G0 X5\nZ2\nG1 Z-3\nG0 Z2\nX6\nG1 Z-3\nG0 Z10\nX7",
    "G81 X5 Z-3 R2\nZ-4 X6\nR3 X7 F200": "G0X5\nZ2\nG1Z-3\nG0Z10\nX6\nZ2\nG1Z-4\nG0Z10\nX7\nZ3\nG1Z-4F200\nG0Z10",
    "G99 G81 X5 Z-3 R2\nG82 X6 Z-4 R1 G98 P1": "G0X5\nZ2\nG1Z-3\nG0Z2\nX6\nZ1\nG1Z-4\nG0Z10",
}


@pytest.mark.parametrize("cycle", WRITTEN_OUT)
def test_cycles_are_the_moves_that_they_stand_for(cycle):
    same(read(START + cycle), read(START + WRITTEN_OUT[cycle].replace("G1", " G1 ")))


@given(floats(0.1, 9), floats(0.3, 20))
def test_pecks_reach_the_bottom_and_cut_every_depth_once(step, depth):
    toolpath = read(f"{START}G83 X5 Z{-depth:.6f} R0 Q{step:.6f}")
    cuts = [c for c in toolpath if not c.rapid]
    again = 0.254e-3 * (len(cuts) - 1)  # what each peck but the first begins above the last one's bottom
    assert sum(c.length for c in cuts) == pytest.approx(
        1e-3 * round(depth, 6) + min(again, 1), abs=2e-9 + again * (step < 0.254)
    )
    assert max(c.length for c in cuts) <= (step + 0.254) * 1e-3 + 2e-9
    assert min(c.end[2] for c in cuts) == pytest.approx(-1e-3 * depth, abs=1e-9)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("G81 X1 Z-1", "G81 without R"),
        ("G81 X1", "G81 without R and Z"),
        ("G83 X1 Z-1 R1", "G83 without Q"),
        ("G83 X1 Z-1 R1 Q0", "Q0 is no depth of pecks"),
        ("G83 X1 Z-1 R1 Q.0001", "Q0.0001 is no depth of pecks"),
        ("G81 X1 Z2 R1", "drills upwards or not at all"),
        ("G81 X1 Z1 R1", "drills upwards or not at all"),
        ("G81 X1 Z-1 R1 L0", "L0 is no number of repetitions"),
        ("G81 X1 Z-1 R1 L1.5", r"L1.5 is no number of repetitions"),
        ("G81 X1 Z-1 R1 L99999999", "is no number of repetitions"),
        ("G18 G81 X1 Z-1 R1", "in the plane XY only"),
        ("G81 X1 Z-1 R1 I5", "I5 is not understood here"),
        ("G81 X1 Z-1 R1 M62 P3", "belongs to the motion, or to a code that moves nothing"),
        ("G99 G81 X1 Z-1 R1\nG91 X1", "R of a cycle in G91"),
        ("G81 X1 Z-1 R1\nG83 X2 Q1", "G83 without R and Z"),
        ("G81 X1 Z-1 R1\nG80\nG81 X2", "G81 without R and Z"),
        ("G81 X1 Z-99999999 R1", "further than 10000 m"),
        ("G28 Z0\nG81 X1 Z-1 R1", "it cuts where Z is not known"),
    ],
)
def test_cycles_that_say_too_little_are_refused(line, message):
    for unknown in ("refuse", "warn"):
        with pytest.raises(ToolpathError, match=f"line {3 + line.count(chr(10))}: .*{message}"):
            read(START + line, unknown=unknown)


def test_a_cycle_needs_a_feed():
    with pytest.raises(ToolpathError, match="before there is a feed"):
        read(HEAD + "G81 X1 Z-1 R1")


# --- arcs ---------------------------------------------------------------------------------------------------


@given(st.integers(1, 5), st.sampled_from(["X10 Y0", "X0 Y10", "X10 Y20"]), floats(-4, 4), st.sampled_from([2, 3]))
def test_turns_of_an_arc_are_a_helix(turns, end, rise, code):
    """P − 1 whole turns and the rest (LinuxCNC, G-Codes, G2 and G3), at a constant pitch."""
    arc = f"G{code} {end} Z{rise:.6f} I0 J10 F600"
    once = read("G21 G90\nG0 X10 Y0 Z0\n" + arc)[0]
    many = read("G21 G90\nG0 X10 Y0 Z0\n" + f"{arc} P{turns}")[0]
    sweep = abs(once.segments[0].sweep) + 2 * np.pi * (turns - 1)
    assert sum(abs(s.sweep) for s in many.segments) == pytest.approx(sweep)
    assert many.length == pytest.approx(np.hypot(0.01 * sweep, round(rise, 6) * 1e-3))
    assert np.allclose(many.end, once.end)
    heights = [s.point(np.linspace(0, 1, 5))[:, 2] for s in many.segments]
    assert np.allclose(np.ptp(heights, axis=1), abs(round(rise, 6)) * 1e-3 / turns)


@pytest.mark.parametrize("turns", ["0", "1.5", "-2", "9999999"])
def test_turns_are_a_whole_number(turns):
    with pytest.raises(ToolpathError, match="is no number of turns of an arc"):
        read(HEAD + f"G2 X2 I1 F60 P{turns}")


@given(floats(1, 200), floats(0, 6.28), floats(0.3, 6), st.sampled_from([1, 2, 3]), st.booleans())
def test_rounded_arcs_are_read_with_the_tolerance_that_the_message_says(radius, angle, turned, decimals, by_radius):
    start, end = (radius * np.array([np.cos(a), np.sin(a)]) for a in (angle, angle + turned))
    r = radius if turned <= np.pi else -radius
    centre = f"R{r:.{decimals}f}" if by_radius else f"I{-start[0]:.{decimals}f} J{-start[1]:.{decimals}f}"
    program = f"G21 G90\nG0 X{start[0]:.{decimals}f} Y{start[1]:.{decimals}f} Z0\nG3 X{end[0]:.{decimals}f}"
    program += f" Y{end[1]:.{decimals}f} {centre} F600"
    options = {}
    try:
        toolpath = read(program)
    except ToolpathError as error:
        assert " arc_tolerance=" in str(error) or by_radius  # noqa: PT017
        options["arc_tolerance"] = float(str(error).partition("arc_tolerance=")[2].split()[0])
        assert options["arc_tolerance"] <= 5e-3 * 10.0**-decimals
        toolpath = read(program, **options)
    (segment,) = toolpath[0].segments
    off = np.abs(np.linalg.norm(segment.point(np.linspace(0, 1, 33)), axis=-1) - 1e-3 * radius)
    if not by_radius:  # which the centre of nearly half a turn follows from badly
        assert off.max() < 5e-3 * 10.0**-decimals
    assert np.allclose(1e3 * segment.last[:2], end, rtol=0, atol=0.51 * 10.0**-decimals)


def test_the_other_way_of_centres_is_proposed_where_it_fits():
    with pytest.raises(ToolpathError, match=r"absolute one, G90\.1, it would be"):
        read("G21 G90 F60\nG0 X30 Y20 Z0\nG3 X20 Y30 I20 J20")
    with pytest.raises(ToolpathError, match=r"relative to the start, G91\.1"):
        read("G21 G90 F60 G90.1\nG0 X30 Y20 Z0\nG3 X20 Y30 I-10 J0")
    with pytest.raises(ToolpathError, match="are its centre, I J K, and its end those of one arc"):
        read("G21 G90 F60\nG0 X10 Y0 Z0\nG3 X0 Y10 I0 J3")


@pytest.mark.parametrize("words", ["J0 K0", "J0 K0."])
def test_a_centre_may_say_that_it_is_in_the_plane(words):
    quarter = read(f"G21 G17\nG0 X10 Y0 Z3\nG3 X0 Y10 I-10 {words} F500")
    assert quarter[0].length == pytest.approx(np.pi / 2 * 0.01)
    absolute = read("G21 G17 G90.1\nG0 X10 Y0 Z3\nG3 X0 Y10 I0 J0 K3 F500")
    same(absolute, quarter)
    with pytest.raises(ToolpathError, match="K2 leads out of the plane of G17"):
        read("G21 G17\nG0 X10 Y0 Z3\nG3 X0 Y10 I-10 K2 F500")
