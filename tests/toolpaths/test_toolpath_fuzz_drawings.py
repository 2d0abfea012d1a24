"""Whatever is in a drawing: its reader returns contours of finite numbers, or says what is wrong."""

from __future__ import annotations

import io

import ezdxf
import numpy as np
import pytest
from drawings import svg
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import PathControlError
from pathcontrol.toolpaths.dxf.reader import read_dxf
from pathcontrol.toolpaths.svg.reader import read_svg

WORDS = ["0", "-1", "1e-300", "1e300", "1e999", "nan", "inf", "0.1.2", "--", "e", "#", "", "%", "9" * 400, "Ω", "\x01"]
NUMBERS = st.one_of(st.floats(-200, 200).map(repr), st.integers(-9, 9).map(str), st.sampled_from(WORDS))
READERS = {"svg": read_svg, "dxf": read_dxf}

SVG = svg(
    '<style>.h{display:none} #k{transform:scale(2)}</style><defs><symbol id="s" viewBox="0 0 9 9" width="9">'
    '<circle id="k" class="c" cx="1" cy="2" r="10%"/></symbol></defs><g transform="rotate(20 3 4) skewX(9)">'
    '<path id="p" d="M1 2h3v-4L5 6q1 2 3 4t5 6c1 2 3 4 5 0s7 8 9 9a4 3 20 0 1 2-5z"/>'
    '<use href="#s" x="1mm" y="2" height="8"/><rect class="h" width="3" height="4" rx="1"/></g>'
    '<svg x="9" width="50%" viewBox="-1 -1 3 3" preserveAspectRatio="xMinYMax slice">'
    '<polygon points="0,0 1,1 2-1"/></svg>'
)


def dxf() -> str:
    document = ezdxf.new("R2000", units=4)
    modelspace, block = document.modelspace(), document.blocks.new("B", base_point=(1, 2))
    block.add_lwpolyline([(0, 0, 0.5), (1, 0, 0), (4, 5, -2)], format="xyb", close=True)
    block.add_line((0, 0), (3, 4), dxfattribs={"layer": "other"})
    modelspace.add_blockref("B", (1, 1), dxfattribs={"xscale": 2, "rotation": 30, "row_count": 2, "row_spacing": 9})
    modelspace.add_polyline2d([(0, 0, 1), (5, 5, 0)], format="xyb")
    modelspace.add_arc((1, 2), 3, 20, 290, dxfattribs={"extrusion": (0, 0, -1)})
    modelspace.add_ellipse((1, 2), (3, 1), 0.4, 0.2, 5)
    modelspace.add_open_spline([(0, 0), (1, 2), (3, 1), (4, 4), (5, 0)]).weights = [1, 2, 3, 2, 1]
    modelspace.add_spline(fit_points=[(0, 0), (1, 1), (2, 0)])
    stream = io.StringIO()
    document.write(stream)
    text = stream.getvalue()
    return "  0\nSECTION\n  2\nHEADER\n" + text[text.index("  9\n$ACADVER") :]


VALID = {"svg": SVG, "dxf": dxf()}


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")

    def checker(kind: str, data: bytes) -> bool:
        """Whether the file is read; what is read is finite."""
        path = folder / f"drawing.{kind}"
        path.write_bytes(data)
        refused = ""
        try:
            toolpath = READERS[kind](path)
        except PathControlError as error:
            refused = str(error)
        if refused:
            assert path.name in refused
            return False
        for contour in toolpath:
            assert np.isfinite([contour.start, contour.end, *contour.bounds]).all()
            assert np.abs(contour.bounds).max() < 1e7
            assert contour.closed == (np.linalg.norm(contour.end - contour.start) <= 1e-9)
        return True

    return checker


def test_the_files_that_are_mutated_are_valid(check):
    for kind, text in VALID.items():
        assert check(kind, text.encode())


@pytest.mark.parametrize("kind", VALID)
@given(data=st.one_of(st.binary(max_size=300), st.text(max_size=300).map(lambda text: text.encode("utf-8", "replace"))))
def test_arbitrary_files(check, kind, data):
    check(kind, data)


@st.composite
def mutations(draw, text: str):
    """A valid file with stretches deleted, repeated, moved, or numbers and characters replaced."""
    for _ in range(draw(st.integers(1, 4))):
        a, length = draw(st.integers(0, len(text))), draw(st.integers(0, 60))
        b = min(len(text), a + length)
        kind = draw(st.integers(0, 3))
        if kind == 0:
            text = text[:a] + text[b:]
        elif kind == 1:
            text = text[:b] + text[a:b] * draw(st.integers(1, 3)) + text[b:]
        elif kind == 2:
            text = text[:a] + draw(st.one_of(NUMBERS, st.text(max_size=3))) + text[b:]
        else:
            where = draw(st.integers(0, len(text)))
            text = text[:where] + text[a:b] + text[where:]
    return text


@given(mutations(VALID["svg"]))
@settings(max_examples=50)
def test_mutated_svg(check, text):
    check("svg", text.encode("utf-8", "replace"))


@st.composite
def entity_mutations(draw):
    """A valid drawing with values in its blocks and entities replaced, and lines taken away or doubled."""
    lines = VALID["dxf"].split("\n")
    begin = lines.index("BLOCKS")
    for _ in range(draw(st.integers(1, 6))):
        i = draw(st.integers(begin, len(lines) - 1))
        kind = draw(st.integers(0, 5))
        if kind == 0:
            del lines[i : i + draw(st.integers(1, 2))]
        elif kind == 1:
            lines[i:i] = lines[i : i + 2]
        else:
            lines[i] = draw(NUMBERS)
    return "\n".join(lines)


@given(entity_mutations())
def test_mutated_dxf(check, text):
    check("dxf", text.encode("utf-8", "replace"))


@given(mutations(VALID["dxf"]))
def test_dxf_mutated_anywhere(check, text):
    check("dxf", text.encode("utf-8", "replace"))


COMMANDS = st.sampled_from([*"MmLlHhVvCcSsQqTtAaZz", ",", " ", "0", "1", ".5", "-3", "20", "1e-9"])


@given(st.lists(st.one_of(COMMANDS, COMMANDS, NUMBERS), max_size=40), st.lists(NUMBERS, min_size=6, max_size=6))
@settings(max_examples=50)
def test_path_data_of_any_tokens(check, tokens, matrix):
    attributes = f'd="M1 2{" ".join(tokens)}" transform="matrix({" ".join(matrix)})"'
    check("svg", svg(f"<path {attributes}/>".replace("\x01", "")).encode())


NICE = st.one_of(st.integers(-20, 20).map(float), st.floats(-100, 100), st.sampled_from([1e-12, 1e-7, -1e-9]))
PAIR = st.tuples(NICE, NICE).map(lambda xy: f" {xy[0]!r} {xy[1]!r}")
RADIUS = st.one_of(st.just(" 0"), st.floats(0.1, 50).map(lambda r: f" {r!r}"))
FLAG = st.sampled_from([" 0", " 1"])
PIECE = st.one_of(
    st.tuples(st.sampled_from("LlMmTt"), PAIR),
    st.tuples(st.sampled_from("QqSs"), PAIR, PAIR),
    st.tuples(st.sampled_from("Cc"), PAIR, PAIR, PAIR),
    st.tuples(st.sampled_from("Aa"), RADIUS, RADIUS, NICE.map(lambda x: f" {x!r}"), FLAG, FLAG, PAIR),
    st.just(("z",)),
).map("".join)


@given(st.lists(PIECE, min_size=1, max_size=12))
@settings(max_examples=50)
def test_every_path_by_the_grammar_is_read(check, pieces):
    """With flat, coincident, folded and tiny curves among them; the line at the end is always drawn."""
    assert check("svg", svg(f'<path d="M3 4{"".join(pieces)}M0 0H1"/>').encode())
