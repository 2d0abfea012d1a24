"""SVG drawings: every command, shape, unit, transform and element draws what the specification says."""

from __future__ import annotations

import numpy as np
import pytest
from drawings import U, bezier, samples, svg, upright, write
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.svg.reader import read_svg

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    folder = tmp_path_factory.mktemp("svg")

    def reader(body, attributes=None, **options):
        text = svg(body) if attributes is None else svg(body, attributes)
        return read_svg(write(folder, text), **options)

    return reader


class Author:
    """Writes path data in absolute, relative and shorthand forms, and knows the curves by their own formulas."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.at, self.data, self.curves = complex(*self.rng.uniform(0, 40, 2)), "", []
        self.data = f"M{self.pair(self.at)}"
        self.handle = ("", 0j)

    @staticmethod
    def pair(z: complex) -> str:
        return f"{z.real!r},{z.imag!r}".replace("+", "")

    def point(self) -> complex:
        return complex(*self.rng.uniform(0, 40, 2))

    def write(self, letter: str, *points: complex) -> None:
        relative = self.rng.random() < 0.5
        origin = self.at if relative else 0j
        self.data += (letter.lower() if relative else letter) + " ".join(self.pair(p - origin) for p in points)

    def draw(self, letter: str) -> None:
        start, end = self.at, self.point()
        if letter in "HV":
            end = complex(end.real, start.imag) if letter == "H" else complex(start.real, end.imag)
            self.data += f"{letter}{end.real if letter == 'H' else end.imag!r}"
            self.curves.append(start + U * (end - start))
        elif letter == "A":
            end = self.arc(start)
        else:
            self.polynomial(letter, start, end)
        self.at = end
        if letter in "LHVA":
            self.handle = ("", 0j)

    def polynomial(self, letter: str, start: complex, end: complex) -> None:
        inner = [self.point() for _ in range({"L": 0, "Q": 1, "T": 0, "C": 2, "S": 1}[letter])]
        self.write(letter, *inner, end)
        kind = {"T": "Q", "S": "C"}.get(letter, letter)
        if letter in "TS":
            inner.insert(0, 2 * start - self.handle[1] if self.handle[0] == kind else start)
        straight = letter == "T" and inner[0] == start  # a curve on a line is drawn at the pace of a line
        self.curves.append(bezier([start, end] if straight else [start, *inner, end]))
        self.handle = (kind, inner[-1]) if inner else ("", 0j)

    def arc(self, start: complex) -> complex:
        """From centre, radii and angles to the form with end points, the opposite way of the reader."""
        (rx, ry), turn = self.rng.uniform(1, 30, 2), self.rng.uniform(0, TURN)
        first, sweep = self.rng.uniform(0, TURN), self.rng.uniform(0.3, 6.0) * self.rng.choice([-1, 1])
        angle = first + U * sweep
        shape = (rx * np.cos(angle) + 1j * ry * np.sin(angle)) * np.exp(1j * turn)
        curve = start + shape - shape[0]
        flags = f"{int(abs(sweep) > np.pi)} {int(sweep > 0)}"
        self.data += f"A{float(rx)!r} {float(ry)!r} {float(np.degrees(turn))!r} {flags} {self.pair(complex(curve[-1]))}"
        self.curves.append(curve)
        return complex(curve[-1])


@given(st.integers(0, 10**6), st.text("LHVCSQTA", min_size=1, max_size=12))
def test_path_data_draws_the_curves_it_stands_for(read, seed, letters):
    author = Author(seed)
    for letter in letters:
        author.draw(letter)
    author.data += "z"
    author.curves.append(author.at + U * (author.curves[0][0] - author.at))
    (contour,) = read(f'<path d="{author.data}"/>')
    assert contour.closed
    drawn, curves = samples(contour), [c for c in author.curves if abs(c[-1] - c[0]) > 0]
    assert np.abs(drawn - upright(np.array(curves))).max() < 1e-11


@given(st.integers(0, 10**6), st.text("LCQA", min_size=1, max_size=8))
def test_paths_agree_with_svgpathtools(read, seed, letters):
    engine = pytest.importorskip("svgpathtools")
    author = Author(seed)
    for letter in letters:
        author.draw(letter)
    (contour,) = read(f'<path d="{author.data}"/>')
    theirs = [np.array([piece.point(u) for u in U]) for piece in engine.parse_path(author.data)]
    assert np.abs(samples(contour) - upright(np.array(theirs))).max() < 1e-9


@pytest.mark.parametrize(
    ("data", "same"),
    [
        ("M1 2 3 4 5 6", "M1 2L3 4L5 6"),
        ("m1 2 2 2 2 2z", "M1,2 L3,4 L5,6 L1,2"),
        ("M1 2H3 5V4 7h-1-1v-2", "M1 2L3 2L5 2L5 4L5 7L4 7L3 7L3 5"),
        ("M.5.5.5-1-.5+2e0", "M 0.5 0.5 L 0.5 -1 L -0.5 2"),
        ("M0 0a5 5 0 0110 0 5 5 0 01-10 0", "M0 0A5 5 0 0 1 10 0A5 5 0 0 1 0 0"),
        ("M0 0Q5 5 10 0T20 0T30 0", "M0 0Q5 5 10 0Q15-5 20 0Q25 5 30 0"),
        ("M0 0C1 5 4 5 5 0S9-5 10 0", "M0 0C1 5 4 5 5 0C6-5 9-5 10 0"),
        ("M0 0L9 9T5 0", "M0 0L9 9L5 0"),
        ("M0 0A-5-4 380 0 1 3 3", "M0 0A5 4 20 0 1 3 3"),
        ("M0 0A0 4 0 0 1 3 3", "M0 0L3 3"),
        ("M0 0C1 5 4 5 5 0A1 1 0 0 1 5 0S9-5 10 0", "M0 0C1 5 4 5 5 0C5 0 9-5 10 0"),
        ("M0 0A1 1 0 1 0 8 0", "M0 0A4 4 0 0 0 8 0"),
        ("\n M\t0,0 ,L 3 , 4\r", "M0 0L3 4"),
    ],
)
def test_forms_of_path_data_that_mean_the_same(read, data, same):
    if ",L" in data:
        with pytest.raises(ToolpathError, match="expected numbers"):
            read(f'<path d="{data}"/>')
        return
    a, b = (read(f'<path d="{d}"/>')[0] for d in (data, same))
    assert np.abs(samples(a) - samples(b)).max() < 1e-12


def test_subpaths_become_contours_and_begin_where_the_last_one_did(read):
    contours = read('<path id="p" d="M0 0H4V3zl1 1m1 0h2zM9 9zM7 7l0 0"/><path d="M0 0H1"/>')
    assert [c.name for c in contours] == ["p/1", "p/2", "p/3", "path 2"]
    assert [c.closed for c in contours] == [True, False, True, False]
    assert [c.length for c in contours] == pytest.approx([0.012, np.sqrt(2) * 1e-3, 0.004, 0.001])
    assert np.allclose(contours[1].start, upright(0j))
    assert np.allclose(contours[2].start, upright(2 + 1j))


@pytest.mark.parametrize("gap", [0.1, 1e-3, 1e-6])
def test_arcs_of_large_radius_keep_their_sagitta(read, gap):
    (contour,) = read(f'<path d="M0 0A{5 / gap!r} {5 / gap!r} 0 0 1 10 0"/>')
    middle = contour.segments[0].point(np.array(0.5)) * 1e3
    sagitta = 5 * gap / (1 + np.sqrt(1 - gap**2))
    assert np.abs(contour.end - upright(10 + 0j)).max() < 1e-15
    assert middle[1] - 50 == pytest.approx(sagitta, rel=1e-5, abs=1e-12)


# --- shapes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "data"),
    [
        ('<rect x="1" y="2" width="10" height="4"/>', "M1 2H11V6H1z"),
        (
            '<rect width="10" height="6" rx="2"/>',
            "M2 0H8A2 2 0 0 1 10 2V4A2 2 0 0 1 8 6H2A2 2 0 0 1 0 4V2A2 2 0 0 1 2 0z",
        ),
        ('<rect width="4" height="6" ry="3"/>', "M2 0A2 3 0 0 1 4 3A2 3 0 0 1 2 6A2 3 0 0 1 0 3A2 3 0 0 1 2 0z"),
        ('<line x1="1" y1="2" x2="3" y2="5"/>', "M1 2L3 5"),
        ('<polyline points="1,2 3 4-1-2"/>', "M1 2L3 4L-1-2"),
        ('<polygon points="1,2 3,4 5,0"/>', "M1 2L3 4L5 0z"),
    ],
)
def test_shapes_are_the_paths_that_the_specification_gives(read, shape, data):
    a, b = read(shape)[0], read(f'<path d="{data}"/>')[0]
    assert a.closed == b.closed
    assert np.abs(samples(a) - samples(b)).max() < 1e-12


@given(st.integers(0, 10**6))
def test_circles_and_ellipses_are_one_arc(read, seed):
    x, y, rx, ry = np.random.default_rng(seed).uniform(1, 20, 4)
    circle, ellipse = read(f'<circle cx="{x}" cy="{y}" r="{rx}"/><ellipse cx="{x}" cy="{y}" rx="{rx}" ry="{ry}"/>')
    assert circle.closed
    assert ellipse.closed
    assert circle.length == pytest.approx(TURN * rx * 1e-3)
    expected = complex(x, y) + rx * np.cos(TURN * U) + 1j * ry * np.sin(TURN * U)
    assert np.abs(samples(ellipse)[0] - upright(expected)).max() < 1e-12


# --- curves that stand still ----------------------------------------------------------------------------------------


def test_a_cusp_divides_a_curve_and_a_loop_does_not(read):
    (cusp,) = read('<path d="M0 0C10 10 0 10 10 0"/>')
    assert len(cusp.segments) == 2
    assert np.allclose(cusp.segments[0].point(np.array(1.0)), upright(5 + 7.5j), atol=1e-15)
    assert np.abs(cusp.segments[0].point(U) - upright(bezier([0j, 5 + 5j, 5 + 7.5j, 5 + 7.5j]))).max() < 1e-15
    assert len(read('<path d="M0 0C20 10-10 10 10 0"/>')[0].segments) == 1
    (smooth,) = read('<path d="M0 0C0 0 5 9 10 0"/>')  # a handle drawn in: only its end stands still
    assert len(smooth.segments) == 1


@given(st.integers(0, 10**6))
def test_both_sides_of_a_cusp_stand_still_there(read, seed):
    """So that rounding does not decide about the tangent."""
    cusp = '<path d="M0 0C10 10 0 10 10 0"/>'
    (contour,) = read(f'<g transform="{random_transform(np.random.default_rng(seed))[0]}">{cusp}</g>')
    before, after = contour.segments
    assert not before.derivative(np.array(1.0)).any()
    assert np.abs(after.derivative(np.array(0.0))).max() < 1e-16


def test_a_curve_on_a_line_becomes_lines_with_its_turning_points(read):
    (fold,) = read('<path d="M0 0C20 0-10 0 10 0"/>')
    assert [type(s) for s in fold.segments] == [Polyline]
    x = np.polyval([100, -150, 60, 0], np.sort(np.roots([300, -300, 60])))  # where x(u) = 60u − 150u² + 100u³ turns
    assert np.allclose(fold.segments[0].points, upright(np.array([0, *x, 10], dtype=complex)))
    (flat,) = read('<ellipse transform="scale(1,1e-13)" rx="10" ry="1"/>')
    assert flat.length == pytest.approx(0.04)
    for sweep in (0, 1):
        (arc,) = read(f'<path transform="scale(1e-13 1)" d="M0 0A6 6 0 1 {sweep} 0 10"/>')
        (polyline,) = arc.segments
        assert np.allclose(polyline.points, upright(1j * np.array([0, -1, 11, 10])), atol=1e-12)


# --- units, page and transforms -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "inch"), [("mm", 25.4), ("cm", 2.54), ("in", 1.0), ("pt", 72.0), ("pc", 6.0), ("Q", 101.6), ("px", 96.0)]
)
def test_the_same_drawing_in_any_unit(read, unit, inch):
    body = f'<rect x="{inch}{unit}" y="{inch / 2}{unit}" width="{2 * inch}{unit}" height="{inch}{unit}"/>'
    reference = np.array([[1, 2.5], [3, 2.5], [3, 1.5], [1, 1.5], [1, 2.5]]) * 0.0254
    for attributes in (
        f'width="{5 * inch}{unit}" height="{3 * inch}{unit}"',
        f'width="{5 * inch}{unit}" height="{3 * inch}{unit}" viewBox="0 0 480 288"',
        'viewBox="0 0 480 288"',
    ):
        toolpath = read(body, attributes)
        assert np.abs(toolpath[0].segments[0].points[:, :2] - reference).max() < 1e-15
        assert toolpath.unit == (unit if "width" in attributes else "px")


def test_pixels_per_inch(read):
    drawing = '<path d="M0 0H72"/>', 'width="72" height="72"'
    assert read(*drawing, ppi=72)[0].length == pytest.approx(0.0254, rel=1e-15)
    assert read(*drawing)[0].length == pytest.approx(0.01905, rel=1e-15)


@pytest.mark.parametrize(
    ("aspect", "scale", "corner"),
    [
        ("", 1.0, (30, 0)),
        ("xMidYMid meet", 1.0, (30, 0)),
        ("xMinYMin", 1.0, (0, 0)),
        ("xMaxYMax", 1.0, (60, 0)),
        ("xMinYMin slice", 2.5, (0, 0)),
        ("xMidYMid slice", 2.5, (0, -37.5)),
        ("xMaxYMax slice", 2.5, (0, -75)),
        ("none", (2.5, 1.0), (0, 0)),
    ],
)
def test_the_view_box_is_fitted_into_the_page(read, aspect, scale, corner):
    attribute = f'preserveAspectRatio="{aspect}"' if aspect else ""
    page = f'width="100mm" height="50mm" viewBox="-5 10 40 50" {attribute}'
    (square,) = read('<rect x="-5" y="10" width="40" height="50"/>', page)
    size = np.array([40.0, 50.0]) * scale
    low, high = square.bounds
    assert np.allclose([low[0], 0.05 - high[1]], np.array(corner) * 1e-3, atol=1e-15)
    assert np.allclose((high - low)[:2], size * 1e-3)


@pytest.mark.parametrize("given_", ['width="4in"', 'height="3in"', 'width="4in" height="3in"', 'style="height:288px"'])
def test_a_missing_side_of_the_page_follows_from_the_view_box(read, given_):
    (line,) = read('<path d="M0 3H4"/>', f'viewBox="0 0 4 3" {given_}')
    assert np.abs(line.segments[0].points - [[0, 0, 0], [0.1016, 0, 0]]).max() < 1e-15


def random_transform(rng: np.random.Generator) -> tuple[str, np.ndarray]:
    """A transform function and its matrix (3, 3) by the definitions in the specification."""
    a, b, angle = *rng.uniform(-3, 3, 2), rng.uniform(-170, 170)
    cos, sin, tan = np.cos(np.radians(angle)), np.sin(np.radians(angle)), np.tan(np.radians(angle / 4))
    turn, go = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]), np.array([[1, 0, a], [0, 1, b], [0, 0, 1]])
    v = rng.uniform(-2, 2, 6)
    return [
        (f"matrix({','.join(map(repr, v.tolist()))})", np.array([[v[0], v[2], v[4]], [v[1], v[3], v[5]], [0, 0, 1]])),
        (f"translate({a} , {b})", go),
        (f"translate({a})", np.array([[1, 0, a], [0, 1, 0], [0, 0, 1]])),
        (f"scale({a} {b})", np.diag([a, b, 1])),
        (f"scale({a})", np.diag([a, a, 1])),
        (f"rotate({angle})", turn),
        (f"rotate({angle} {a} {b})", go @ turn @ np.linalg.inv(go)),
        (f"skewX({angle / 4})", np.array([[1, tan, 0], [0, 1, 0], [0, 0, 1]])),
        (f"skewY({angle / 4})", np.array([[1, 0, 0], [tan, 1, 0], [0, 0, 1]])),
    ][rng.integers(9)]


@given(st.integers(0, 10**6), st.integers(1, 5))
def test_nested_transforms_are_the_product_of_their_matrices(read, seed, depth):
    rng = np.random.default_rng(seed)
    shapes = '<path d="M1 2C3 9 7 8 9 1L2 3A5 3 20 1 1 4 7"/><ellipse cx="3" cy="4" rx="2" ry="1"/>'
    matrix, body = np.eye(3), shapes
    for _ in range(depth):
        texts, parts = zip(*(random_transform(rng) for _ in range(rng.integers(1, 3))), strict=True)
        body = f'<g transform="{" ".join(texts)}">{body}</g>'
        for part in reversed(parts):
            matrix = part @ matrix
    scale = np.abs(matrix).max()
    for flat, mapped in zip(read(shapes), read(body), strict=True):
        x = samples(flat) * [1e3, -1e3, 1] + [0, 50, 0]
        image = x[..., :2] @ matrix[:2, :2].T + matrix[:2, 2]
        assert np.abs(samples(mapped) - upright(image[..., 0] + 1j * image[..., 1])).max() < 1e-13 * (1 + scale)
        assert [type(s) for s in mapped.segments] == [type(s) for s in flat.segments]


def test_arcs_and_curves_stay_what_they_are(read):
    (contour,) = read('<path transform="skewX(30) scale(2 1)" d="M0 0L1 0A2 3 0 0 1 4 4C5 5 7 5 8 0"/>')
    assert [type(s) for s in contour.segments] == [Polyline, Arc, Bezier]
    assert (contour.feed, contour.rapid) == (None, False)
    assert read('<path d="M0 0H1"/>', feed=0.02)[0].feed == 0.02


@pytest.mark.parametrize("option", [{"ppi": 0}, {"ppi": np.nan}, {"feed": -1}, {"feed": "fast"}])
def test_bad_options(read, option):
    with pytest.raises(InputError, match=next(iter(option))):
        read('<path d="M0 0H1"/>', **option)
