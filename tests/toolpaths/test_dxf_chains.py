"""Loose curves of DXF drawings become contours: deterministic, exact at the joints, and within the tolerance."""

from __future__ import annotations

import ezdxf
import numpy as np
import pytest
from drawings import samples
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.dxf.reader import read_dxf

NEAR = 1e-6  # m


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chains")

    def reader(pieces, layers=None, **options):
        """The toolpath of lines (a, b), arcs (a, b, bulge) and curves [a, b, c, …] between complex points [m]."""
        document = ezdxf.new("R2010", units=6)
        layers = layers or ["0"] * len(pieces)
        for piece, layer in zip(pieces, layers, strict=True):
            _add(document.modelspace(), piece, {"layer": str(layer)})
        document.saveas(folder / "drawing.dxf")
        return read_dxf(folder / "drawing.dxf", **options)

    return reader


def _add(modelspace, piece, attributes) -> None:
    points = [(complex(p).real, complex(p).imag) for p in (piece if isinstance(piece, list) else piece[:2])]
    if isinstance(piece, list):
        modelspace.add_open_spline(points, degree=len(piece) - 1, dxfattribs=attributes)
    elif len(piece) == 2:
        modelspace.add_line(*points, dxfattribs=attributes)
    else:
        center, start, end, radius = ezdxf.math.bulge_to_arc(*points, piece[2])
        modelspace.add_arc(center, radius, np.degrees(start), np.degrees(end), dxfattribs=attributes)


def ring(rng: np.random.Generator, count: int) -> list:
    """A star-shaped outline of lines, arcs and cubics, one after another."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    corners = rng.uniform(1, 2, count) * np.exp(1j * angle)
    pieces = []
    for a, b in zip(corners, np.roll(corners, -1), strict=True):
        kind = rng.integers(3)
        handles = [a + (b - a) * (0.3 + 0.1j), a + (b - a) * (0.6 - 0.1j)]
        pieces.append([(a, b), (a, b, rng.uniform(0.1, 0.9)), [a, *handles, b]][kind])
    return pieces


def turned(piece):
    """The piece drawn from its other end."""
    if isinstance(piece, list):
        return piece[::-1]
    return (piece[1], piece[0], -piece[2]) if len(piece) == 3 else piece[::-1]


@settings(max_examples=5)
@given(st.integers(0, 10**6), st.integers(3, 12), st.booleans())
def test_shuffled_and_turned_pieces_become_the_outline_again(read, seed, count, closed):
    rng = np.random.default_rng(seed)
    pieces = ring(rng, count)[: None if closed else -1]
    order = rng.permutation(len(pieces))
    # arcs of DXF always run counterclockwise: negative bulges cannot be written, so arcs are not turned
    loose = [turned(pieces[i]) if rng.random() < 0.5 and len(pieces[i]) != 3 else pieces[i] for i in order]
    contour, *alone = read(loose + pieces, ["whole"] * len(loose) + list(range(len(pieces))))
    assert contour.closed == closed
    assert len(alone) == len(pieces)
    assert contour.length == pytest.approx(sum(c.length for c in alone), rel=1e-12)
    joints = np.array([complex(p[0]) for p in pieces])
    where = samples(contour)[:, 0]
    drawn = np.concatenate([where[:, 0] + 1j * where[:, 1], [complex(*contour.end[:2])]])
    assert np.abs(joints[:, None] - drawn).min(1).max() < 1e-12


def test_a_chain_begins_and_runs_as_its_first_piece(read):
    square = [(1 + 1j, 1j), (1j, 0j), (0j, 1 + 0j), (1 + 0j, 1 + 1j)]
    for i in range(4):
        (contour,) = read(square[i:] + square[:i])
        assert complex(*contour.start[:2]) == square[i][0]
        assert complex(*contour.segments[0].points[1][:2]) == square[i][1]
    (contour,) = read([(2 + 0j, 1 + 0j), (0j, 1 + 0j), (3 + 1j, 2 + 0j)])
    assert [complex(*p[:2]) for p in contour.segments[0].points] == [3 + 1j, 2 + 0j, 1 + 0j, 0j]


def test_contours_come_in_the_order_of_their_first_pieces(read):
    contours = read([(0j, 1 + 0j), (5j, 1 + 5j), (1 + 0j, 2 + 0j), (9j, 9j + 1), (1 + 5j, 2 + 5j)])
    assert [c.start[1] for c in contours] == [0, 5, 9]
    assert [c.name.split(" + ")[1:] for c in contours] == [["1"], ["1"], []]


def test_where_more_than_two_ends_meet_chains_end(read):
    star = [(0j, np.exp(2j * np.pi * k / 5)) for k in range(5)]
    assert len(read(star)) == 5
    contours = read([(-2 + 0j, -1 + 0j), (-1 + 0j, 0j), (0j, 1 + 0j), (0j, 1j)])
    assert [round(c.length) for c in contours] == [2, 1, 1]


def test_pieces_on_different_layers_are_not_chained(read):
    pieces = [(0j, 1 + 0j), (1 + 0j, 2 + 0j), (2 + 0j, 3 + 0j)]
    assert len(read(pieces)) == 1
    assert len(read(pieces, ["a", "b", "a"])) == 3
    assert len(read(pieces, ["a", "a", "b"])) == 2


@settings(max_examples=5)
@given(st.integers(0, 10**6), st.integers(3, 8), st.sampled_from([2e-9, 1e-8, 0.9e-6]))
def test_small_gaps_are_closed_by_moving_both_ends(read, seed, count, gap):
    rng = np.random.default_rng(seed)
    pieces = ring(rng, count)
    apart = [
        [p + 0.5 * gap * np.exp(1j * rng.uniform(0, 6)) for p in piece]
        if isinstance(piece, list)
        else tuple(p + 0.5 * gap * np.exp(1j * rng.uniform(0, 6)) for p in piece[:2]) + tuple(piece[2:])
        for piece in pieces
    ]
    contour, *each = read(apart * 2, ["whole"] * count + list(range(count)))
    assert contour.closed  # which needs ends that meet to 1 nm
    assert len(samples(contour)) == count
    for drawn, alone in zip(samples(contour), each, strict=True):
        assert np.abs(drawn - samples(alone)[0]).max() <= 0.5 * gap + 1e-12


def test_larger_gaps_stay(read):
    assert len(read([(0j, 1 + 0j), (1 + 1.1e-6, 2 + 0j)])) == 2
    assert len(read([(0j, 1e-3 + 0j), (1e-3 + 0.15e-6, 2e-3 + 0j)])) == 1
    assert len(read([(0j, 1e-3 + 0j), (1e-3 + 0.25e-6, 2e-3 + 0j)])) == 2  # 0.01 % of 2 mm


def test_an_ellipse_written_with_few_digits_closes(tmp_path):
    document = ezdxf.new("R2010", units=4)
    document.modelspace().add_ellipse((0, 0), (50, 0), 0.5, 0, 6.283185)
    document.saveas(tmp_path / "drawing.dxf")
    (contour,) = read_dxf(tmp_path / "drawing.dxf")
    assert contour.closed


def test_a_crowd_of_ends_at_one_place(read):
    spokes = [(0j, np.exp(2j * np.pi * k / 1000)) for k in range(1000)]
    assert len(read(spokes)) == 1000


# --- hostile drawings -----------------------------------------------------------------------------------------------

HEAD = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n"
A_LINE = "0\nLINE\n8\n0\n10\n0\n20\n0\n11\n1\n21\n1\n"


def _block(name: str, inside: str) -> str:
    return f"0\nBLOCK\n8\n0\n2\n{name}\n70\n0\n10\n0\n20\n0\n30\n0\n{inside}0\nENDBLK\n8\n0\n"


def _insert(name: str) -> str:
    return f"0\nINSERT\n8\n0\n2\n{name}\n10\n0\n20\n0\n"


def _dxf(entities: str, blocks: str = "", head: str = HEAD) -> str:
    return f"{head}0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n"


BOMB = "".join(_block(f"B{i}", _insert(f"B{i + 1}") * 10) for i in range(12)) + _block("B12", A_LINE)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_dxf(_insert("A"), _block("A", _insert("A") + A_LINE)), "64 blocks"),
        (_dxf(_insert("A"), _block("A", _insert("B")) + _block("B", _insert("A"))), "64 blocks"),
        (_dxf(_insert("B0"), BOMB), "more than 2000 entities"),
        (_dxf(_insert("A") + "70\n30000\n71\n30000\n", _block("A", A_LINE)), "more than 2000 entities"),
        (_dxf("0\nLINE\n8\n0\n10\nnan\n20\n0\n11\n1\n21\n1\n"), "start is .*nan"),
        (_dxf("0\nLINE\n8\n0\n10\n0\n20\n0\n"), "it has no end"),
        (_dxf("0\nARC\n8\n0\n10\n0\n20\n0\n50\n0\n51\n90\n"), "it has no radius"),
        (_dxf("0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n1\n210\n0\n220\n0\n230\n0\n"), "extrusion"),
        (_dxf("0\nWHATEVER\n8\nlayer\n"), "1 WHATEVER"),
        (_dxf(A_LINE, head=""), "no unit of length"),
        ("0" * 200_000, "more than 100000 characters"),
        ("0\nSECTION\n", "no DXF drawing"),
        ("", "no DXF drawing"),
        ("G1 X10\nM30\n", "no DXF drawing"),
    ],
)
def test_hostile_files_end_in_an_error(tmp_path, monkeypatch, text, words):
    monkeypatch.setattr("pathcontrol.toolpaths.dxf.blocks._MOST_ENTITIES", 2000)
    path = tmp_path / "drawing.dxf"
    path.write_text(text)
    with pytest.raises(ToolpathError, match=words):
        read_dxf(path)


def test_files_that_are_too_large_are_not_loaded(tmp_path, monkeypatch):
    path = tmp_path / "drawing.dxf"
    path.write_text(_dxf(A_LINE * 20))
    monkeypatch.setattr("pathcontrol.toolpaths.dxf.reader._MOST_ENTITIES", 15)
    with pytest.raises(ToolpathError, match="entities, expected at most"):
        read_dxf(path)
    monkeypatch.setattr("pathcontrol.toolpaths.dxf.reader._MOST_ENTITIES", 100)
    monkeypatch.setattr("pathcontrol.toolpaths.drawing.pieces.MAX_SEGMENTS", 39)
    with pytest.raises(ToolpathError, match="more than 39 lines"):
        read_dxf(path)


@pytest.mark.parametrize("gap", [4e-5, 1e-4, 1e-3])
def test_a_gap_wider_than_the_lines_of_a_chain_joins_them_all_the_same(read, gap):
    """A small circle of a hundred lines, each shorter than the gap, is one contour; a wide gap elsewhere is closed."""
    corners = 0.5e-3 * np.exp(2j * np.pi * np.arange(100) / 100)
    circle = list(zip(corners, np.roll(corners, -1), strict=True))
    corner = [(0.05, 0.06), (0.06 + 3e-6, 0.06 + 0.01j)]
    found = read([*circle, *corner], gap=gap)
    assert [contour.closed for contour in found.contours] == [True, False]
    lengths = [sum(segment.length for segment in contour.segments) for contour in found.contours]
    assert lengths[0] == pytest.approx(100 * 1e-3 * np.sin(np.pi / 100), rel=1e-6)
    assert lengths[1] == pytest.approx(0.02, rel=1e-3)


def test_a_line_shorter_than_the_gap_that_stays_alone_is_told(read):
    found = read([(0.0, 1e-5), (0.05, 0.06)], gap=1e-4)
    assert any("shorter than the gap of 100 µm stays alone once" in str(note) for note in found.notes)
