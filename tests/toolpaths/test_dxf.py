"""DXF drawings, written with ezdxf: entities, units, layers and blocks against their own formulas."""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np
import pytest
from drawings import TEN, TOGETHER, U, apart, dxf_reader, samples
from ezdxf import path as ezpath
from ezdxf.math import OCS, Matrix44, Vec3
from ezdxf.render import R12Spline
from hypothesis import given

from pathcontrol.errors import InputError, ToolpathError, UnknownNameError
from pathcontrol.toolpaths.dxf.reader import UNITS
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import Polyline

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return dxf_reader(tmp_path_factory.mktemp("dxf"))


def flat(x) -> np.ndarray:
    """Complex numbers as points in the plane z = 0."""
    return np.stack([np.real(x), np.imag(x), 0 * np.real(x)], axis=-1)


# --- entities -------------------------------------------------------------------------------------------------------


def test_lines_and_circles(read):
    line, circle = read(lambda m: (m.add_line((1, 2, 3), (4, 6, 3)), m.add_circle((1, 2, 3), 0.5)), feed=0.01)
    assert np.array_equal(line.segments[0].points, [[1, 2, 3], [4, 6, 3]])
    assert (line.closed, line.feed, line.rapid) == (False, 0.01, False)
    assert circle.closed
    assert circle.length == pytest.approx(np.pi)
    assert np.allclose(samples(circle)[0], [1, 2, 3] + 0.5 * flat(np.exp(1j * TURN * U)), atol=1e-15)


@TOGETHER
@given(TEN)
def test_arcs_run_counterclockwise(read, seeds):
    rngs = [np.random.default_rng(seed) for seed in seeds]
    arcs = [(rng.uniform(0.1, 3), *np.sort(rng.uniform(0, 360, 2))) for rng in rngs]
    found = read(
        apart(
            lambda m, r=radius, a=start, b=end: (m.add_arc((1, 2), r, a, b), m.add_arc((9, 2), r, b, a))
            for radius, start, end in arcs
        )
    )
    for (radius, start, end), there, back in zip(arcs, found[::2], found[1::2], strict=True):
        angle = np.radians(start + U * (end - start))
        assert np.allclose(samples(there)[0], flat(1 + 2j + radius * np.exp(1j * angle)), atol=1e-14)
        assert there.length + back.length == pytest.approx(TURN * radius)


@TOGETHER
@given(TEN)
def test_ellipses(read, seeds):
    rngs = [np.random.default_rng(seed) for seed in seeds]
    ellipses = [
        (rng.normal(size=3) * [1, 1, 0], rng.uniform(0.1, 1), rng.uniform(0, TURN), rng.uniform(0.1, 6)) for rng in rngs
    ]

    def draw(m):
        for major, ratio, start, sweep in ellipses:
            m.add_ellipse((1, 2, 3), major, ratio, start, (start + sweep) % TURN)
            m.add_ellipse((9, 2, 3), major, ratio)

    found = read(draw)
    for (major, ratio, start, sweep), arc, whole in zip(ellipses, found[::2], found[1::2], strict=True):
        phi = start + U[:, None] * sweep
        minor = ratio * np.array([-major[1], major[0], 0])
        assert np.allclose(samples(arc)[0], [1, 2, 3] + np.cos(phi) * major + np.sin(phi) * minor, atol=1e-13)
        assert whole.closed


def bulge_arc(a: complex, b: complex, bulge: float) -> np.ndarray:
    """Points at equal angles on the arc from a to b, by complex interpolation on the circle: an own formula."""
    quarter = np.arctan(bulge)
    share = np.sin(2 * quarter * U) / np.sin(2 * quarter)  # chords of partial arcs over the whole chord
    return a + share * (b - a) * np.exp(1j * 2 * quarter * (U - 1))


@TOGETHER
@given(TEN)
def test_bulges_are_arcs(read, seeds):
    rngs = [np.random.default_rng(seed) for seed in seeds]
    lines = [
        (rng.uniform(-3, 3, 6) + 1j * rng.uniform(-3, 3, 6), rng.uniform(-3, 3, 6) * (rng.random(6) < 0.7))
        for rng in rngs
    ]
    kinds = list(itertools.product(["add_lwpolyline", "add_polyline2d"], [True, False])) * 3

    def drawn(line, kind):
        (corners, bulges), (add, closed) = line, kind
        vertices = np.column_stack([corners.real, corners.imag, bulges]).tolist()
        return lambda m: getattr(m, add)(vertices, format="xyb", close=closed)

    found = read(apart(map(drawn, lines, kinds)))
    for contour, (corners, bulges), (_, closed) in zip(found, lines, kinds[:10], strict=True):
        ring = np.append(corners, corners[:1]) if closed else corners
        expected = [
            bulge_arc(a, b, k) if k else a + U * (b - a)
            for a, b, k in zip(ring[:-1], ring[1:], bulges[: len(ring) - 1], strict=True)
        ]
        assert contour.closed == closed
        assert np.abs(samples(contour) - flat(np.array(expected))).max() < 1e-12
        assert sum(isinstance(s, Arc) for s in contour.segments) == np.count_nonzero(bulges[: len(ring) - 1])


@pytest.mark.parametrize("bulge", [0.9e-3, -1e-5, 1e-8])
def test_shallow_bulges_keep_their_sagitta(read, bulge):
    (contour,) = read(lambda m: m.add_lwpolyline([(0, 0, bulge), (2, 0, 0)], format="xyb"))
    assert contour.segments[0].point(np.array(0.5))[1] == pytest.approx(-bulge, rel=1e-9)
    assert np.abs(contour.segments[-1].point(np.array(1.0)) - [2, 0, 0]).max() < 1e-15
    radius = (1 + bulge**2) / (2 * bulge)
    on_circle = [np.hypot(x - 1, y - (radius - bulge)) for x, y, _ in contour.segments[0].point(U)]
    assert np.allclose(on_circle, abs(radius), rtol=1e-12)


def test_polylines_in_space_and_fitted_ones(read):
    corners = [(0, 0, 0), (1, 0, 1), (1, 1, 2)]
    (open_,) = read(lambda m: m.add_polyline3d(corners))
    (closed,) = read(lambda m: m.add_polyline3d(corners, close=True))
    assert np.array_equal(open_.segments[0].points, corners)
    assert closed.closed
    assert closed.length == pytest.approx(2 * np.sqrt(2) + np.sqrt(6))
    control = [(0, 0), (1, 2), (3, 0), (4, 1)]
    (spline,) = read(
        lambda m: R12Spline(control, degree=3, closed=False).render(m, segments=40), version="R12", unit="m"
    )
    frame = np.min(np.linalg.norm(spline.segments[0].points - [1, 2, 0], axis=-1))
    assert frame > 0.3  # the control point itself is not cut


# --- coordinate systems, blocks -------------------------------------------------------------------------------------


@TOGETHER
@given(TEN)
def test_object_coordinates(read, seeds):
    """Entities drawn in a plane of any normal, against ezdxf's own conversion."""
    normals = [np.random.default_rng(seed).normal(size=3) for seed in seeds] + [np.array([0, 0, -1.0])]

    def draw(m):
        for normal in normals:
            attributes = {"extrusion": normal}
            m.add_arc((1, 2, 3), 2, 20, 130, dxfattribs=attributes)
            corners = [(0, 0, 0.5), (1, 0, 0), (4, 5, 0)]
            m.add_lwpolyline(corners, format="xyb", dxfattribs={**attributes, "elevation": 7})

    found = read(draw)
    angle, (bulge, straight) = np.radians(20 + 110 * U), (bulge_arc(0j, 1 + 0j, 0.5), 1 + U * (3 + 5j))
    for normal, arc, polyline in zip(normals, found[::2], found[1::2], strict=True):
        to_world = OCS(Vec3(normal)).to_wcs
        expected = [to_world(Vec3(1 + 2 * np.cos(a), 2 + 2 * np.sin(a), 3)).xyz for a in angle]
        assert np.allclose(samples(arc)[0], expected, atol=1e-12)
        expected = [[to_world(Vec3(z.real, z.imag, 7)).xyz for z in curve] for curve in (bulge, straight)]
        assert np.allclose(samples(polyline), expected, atol=1e-12)


def fill(block) -> None:
    block.add_lwpolyline([(0, 0, 0.5), (1, 0, 0), (1, 1, 0)], format="xyb")
    block.add_circle((3, 1), 0.5)
    block.add_ellipse((5, 1), (1, 0.5), 0.3, 0.2, 2)
    block.add_spline(fit_points=[(7, 0), (8, 1), (9, 0), (10, 2)])


def random_insert(rng: np.random.Generator) -> dict:
    scale = dict(zip(("xscale", "yscale", "zscale"), rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3), strict=True))
    return {"rotation": rng.uniform(0, 360), "extrusion": (0, 0, rng.choice([-1, 1])), **scale}


@TOGETHER
@given(TEN)
def test_nested_blocks_are_the_product_of_their_matrices(read, seeds):
    wholes = []

    def draw(m, seed, depth):
        rng, whole = np.random.default_rng(seed), Matrix44()
        blocks = [m.doc.blocks.new(f"B{seed}.{i}", base_point=rng.normal(size=3)) for i in range(depth)]
        fill(blocks[-1])
        for parent, block in zip([m, *blocks[:-1]], blocks, strict=True):
            insert = parent.add_blockref(block.name, rng.normal(size=3), dxfattribs=random_insert(rng))
            whole = insert.matrix44() * whole  # row vectors: the innermost comes first
        wholes.append(whole)

    mapped = read(apart(partial(draw, seed=seed, depth=1 + k % 3) for k, seed in enumerate(seeds)))
    plain = list(read(fill)) * len(seeds)
    for one, other, whole in zip(
        plain, mapped, [w for w in wholes for _ in range(len(plain) // len(seeds))], strict=True
    ):
        points = samples(one)
        image = np.array([v.xyz for v in whole.transform_vertices(points.reshape(-1, 3))]).reshape(points.shape)
        assert np.abs(samples(other) - image).max() < 1e-11
        assert [type(s) for s in other.segments] == [type(s) for s in one.segments]


def test_blocks_in_rows_and_columns(read):
    def draw(m):
        m.doc.blocks.new("B").add_line((0, 0), (1, 0))
        grid = {"row_count": 2, "column_count": 3, "row_spacing": 5, "column_spacing": 2, "rotation": 90}
        m.add_blockref("B", (10, 0), dxfattribs=grid)

    starts = np.array([c.start[:2] for c in read(draw)])
    assert np.allclose(starts, [[10 - 5 * row, 2 * column] for row in range(2) for column in range(3)])


def test_attributes_of_blocks_are_text(read):
    def draw(m, visible=True):
        block = m.doc.blocks.new("B")
        block.add_line((0, 0), (1, 0))
        block.add_attdef("TAG", (0, 0), "text")
        m.add_blockref("B", (0, 0)).add_attrib("TAG", "words").is_invisible = not visible

    with pytest.raises(ToolpathError, match="1 ATTRIB on layer '0'"):
        read(draw)
    assert len(read(lambda m: draw(m, visible=False))) == 1


# --- units and layers -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "unit"), [(1, "in"), (2, "ft"), (4, "mm"), (5, "cm"), (6, "m"), (13, "um"), (9, "mil")]
)
def test_units(read, code, unit):
    size = 0.1 / UNITS[unit]
    toolpath = read(lambda m: m.add_line((0, 0), (size, 0)), units=code)
    assert toolpath.unit == unit
    assert toolpath[0].length == pytest.approx(0.1, rel=1e-15)
    assert read(lambda m: m.add_line((0, 0), (size, 0)), units=4, unit=unit)[0].length == pytest.approx(0.1, rel=1e-15)


@pytest.mark.parametrize(("version", "code"), [("R2010", 0), ("R12", 4), ("R2010", 18)])
def test_a_missing_unit_is_asked_for(read, version, code):
    with pytest.raises(ToolpathError, match=r"unit= one of m, dm, cm, mm.*in, ft"):
        read(lambda m: m.add_line((0, 0), (1, 0)), units=code, version=version)
    assert read(lambda m: m.add_line((0, 0), (1, 0)), units=code, version=version, unit="in")[0].length == 0.0254


def layered(m) -> None:
    for name, state in (("cut", "on"), ("frozen", "freeze"), ("off", "off"), ("notes", "on")):
        getattr(m.doc.layers.add(name), state)()
    for i, name in enumerate(["cut", "frozen", "off"]):
        m.add_line((i, 0), (i, 1), dxfattribs={"layer": name})
    block = m.doc.blocks.new("B")
    block.add_line((5, 0), (6, 0))
    block.add_line((5, 2), (6, 2), dxfattribs={"layer": "cut"})
    m.add_blockref("B", (0, 0), dxfattribs={"layer": "frozen"})
    m.add_blockref("B", (0, 5), dxfattribs={"layer": "off"})
    m.add_line((9, 0), (9, 1), dxfattribs={"invisible": 1, "layer": "cut"})
    m.doc.layout("Layout1").add_line((0, 0), (1, 1))


def test_layers(read):
    assert [c.name.split(":")[0] for c in read(layered)] == [
        "cut",
        "cut",
    ]  # off hides what is on 0 in a block, not more
    assert len(read(layered, layers="CUT")) == 3
    assert [c.name.split(":")[0] for c in read(layered, layers=["off", "frozen"])] == ["frozen", "off"] * 2
    with pytest.raises(UnknownNameError, match=r"'milling'.*'cut', 'frozen', 'off', 'notes'"):
        read(layered, layers=["milling"])
    with pytest.raises(ToolpathError, match="draws no outline"):
        read(layered, layers="notes")


def test_what_cannot_be_cut_is_refused_by_layer(read):
    def draw(m):
        layered(m)
        m.add_text("words", dxfattribs={"layer": "notes"})
        m.add_hatch(dxfattribs={"layer": "notes"})
        m.add_3dface([(0, 0), (1, 0), (1, 1)], dxfattribs={"layer": "notes"})

    with pytest.raises(ToolpathError) as error:
        read(draw)
    words = ["1 TEXT on layer 'notes'", "1 HATCH", "1 3DFACE", "layers=", "'cut'"]
    assert all(word in str(error.value) for word in words), str(error.value)
    assert len(read(draw, layers=["cut"])) == 3


# --- errors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda m: m.add_line((0, 0), (np.nan, 1)), ["LINE", "on layer '0'", "end", "nan"]),
        (lambda m: m.add_line((0, 0), (1e5, 0)), ["100000 m", "unit"]),
        (lambda m: m.add_circle((0, 0), -1), ["CIRCLE", "radius is -1"]),
        (lambda m: m.add_circle((0, 0), np.inf), ["radius is inf"]),
        (lambda m: m.add_lwpolyline([(0, 0, np.nan), (1, 1, 0)], format="xyb"), ["LWPOLYLINE", "not finite"]),
        (lambda m: m.add_spline(), ["SPLINE", "0 fit points"]),
        (lambda m: m.add_open_spline([(0, 0), (1, 1)], degree=3), ["SPLINE", "2 control points"]),
        (lambda m: m.add_blockref("X", (0, 0)), ["INSERT", "block 'X'", "not in the file"]),
        (
            lambda m: m.doc.blocks.new("A").add_blockref("A", (0, 0)) and m.add_blockref("A", (0, 0)),
            ["64 blocks", "'A'"],
        ),
    ],
)
def test_bad_entities(read, draw, words):
    with pytest.raises(ToolpathError) as error:
        read(draw)
    assert all(word in str(error.value) for word in ["drawing.dxf", *words]), str(error.value)


@pytest.mark.parametrize("option", [{"unit": "furlong"}, {"feed": 0}, {"layers": [3]}])
def test_bad_options(read, option):
    with pytest.raises((InputError, UnknownNameError), match=next(iter(option))):
        read(lambda m: m.add_line((0, 0), (1, 0)), **option)


def test_paths_of_ezdxf_agree(read):
    """Whole drawings against ezdxf's own flattening: no curve farther away than that is accurate."""

    def draw(m):
        fill(m.doc.blocks.new("B"))
        m.add_blockref("B", (1, 2), dxfattribs={"rotation": 30}).set_scale(2)

    def flattened(m):
        draw(m)
        for entity in m.query("INSERT").first.virtual_entities():
            theirs.append(np.array([v.xyz for v in ezpath.make_path(entity).flattening(1e-4)]))

    theirs: list[np.ndarray] = []
    contours = read(flattened)
    for contour, points in zip(contours, theirs, strict=True):
        assert contour.distance(points).max() < 1e-3
        assert contour.length == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=-1).sum(), rel=1e-3)


def test_polylines_are_merged_into_one(read):
    (contour,) = read(lambda m: m.add_lwpolyline([(0, 0), (0, 0), (1, 0), (1, 1), (1, 1)]))
    assert [type(s) for s in contour.segments] == [Polyline]
    assert len(contour.segments[0].points) == 3
