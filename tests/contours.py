"""Random segments and contours, and how far a contour and curves are apart by dense sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import strategies as st

from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment
from pathcontrol.toolpaths.tool_curve import ToolCurve

SEEDS = st.integers(0, 10**6)
KINDS = ("lines", "arc", "helix", "ellipse", "bezier", "rational", "degenerate", "near cusp")
#: what decides between a smooth junction, a blend and a stop
TURNS = np.deg2rad([0, 1e-7, 1e-5, 1e-2, 1, 4.9, 5.1, 30, 90, 149, 151, 179.9, 180])


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def rotation(rng: np.random.Generator) -> np.ndarray:
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def pose(rng: np.random.Generator, far: float = 1.0) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation(rng), far * rng.normal(size=3)
    return result


def turned(rng: np.random.Generator, t: np.ndarray, angle: float) -> np.ndarray:
    """A unit vector at ``angle`` to t."""
    return np.cos(angle) * t + np.sin(angle) * unit(np.cross(rng.normal(size=3), t))


def segment(kind: str, rng: np.random.Generator, size: float, p: np.ndarray, t: np.ndarray, planar: bool) -> Segment:
    """A segment from p along t, of a size from a thousandth of ``size`` to it."""
    n = unit(np.cross([0.0, 0.0, 1.0] if planar else rng.normal(size=3), t)) * rng.choice([-1, 1])
    scale, away = size * 10 ** rng.uniform(-3, 0), rng.normal(size=(3, 3)) * ([1, 1, 0] if planar else [1, 1, 1])
    if kind == "lines":
        points = [p]
        for _ in range(rng.integers(1, 7)):
            points.append(points[-1] + t * size * 10 ** rng.uniform(-4, 0))
            t = _next(rng, t, planar)
        return Polyline(np.array(points))
    if kind in ("arc", "helix"):
        sweep = rng.choice([0.01, 0.3, np.pi / 2, np.pi, 6.2])
        rise = np.cross(t, n) * scale * rng.uniform(-2, 2) if kind == "helix" else np.zeros(3)
        return Arc(p + scale * n, -scale * n, scale * t, 0.0, sweep * (1 if kind == "arc" else 3), rise)
    if kind == "ellipse":
        flat = 10 ** rng.uniform(-3, 0)
        return Arc(p + scale * flat * n, -scale * flat * n, scale * t, 0.0, rng.choice([0.3, np.pi / 2, 2, 5]))
    ahead = np.outer([rng.uniform(0.1, 1), 1, 2], t)
    if kind == "near cusp":  # x goes 0, 1, 0, 1, and y only nearly with it
        ahead, away = (
            np.outer([1, 0, 1], t) + np.outer([1, 1, 0], n),
            np.outer([1, 0, 0], n) * 10 ** rng.uniform(-7, -1),
        )
    points = np.array([p, *(p + scale * (ahead + away * [[kind == "near cusp"], [1], [1]]))])
    if kind == "degenerate":  # a control point on an end, or both
        which = rng.integers(3)
        points[1], points[2] = points[0] if which != 1 else points[1], points[3] if which else points[2]
    return Bezier(points, 10 ** rng.uniform(-1, 1, 4) if kind == "rational" else None)


def contour(
    rng: np.random.Generator, size: float, kinds: Sequence[str] = KINDS, planar: bool = False, closed: bool = False
) -> Contour:
    """Up to five segments that meet at any turn."""
    p, t = size * rng.normal(size=3), unit(rng.normal(size=3) * ([1, 1, 0] if planar else [1, 1, 1]))
    segments: list[Segment] = []
    for _ in range(rng.integers(1, 6)):
        segments.append(segment(rng.choice(kinds), rng, size, p, t, planar))
        p = segments[-1].point(np.array(1.0))
        t = _next(rng, unit(p - segments[-1].point(np.array(1 - 1e-6))), planar)
    start = segments[0].point(np.array(0.0))
    if closed and np.linalg.norm(p - start) > 1e-9:
        segments.append(Polyline([p, start]))
    return Contour(tuple(segments), closed=closed)


def _next(rng: np.random.Generator, t: np.ndarray, planar: bool) -> np.ndarray:
    turn = rng.choice(TURNS) if rng.random() < 0.7 else rng.uniform(0, np.pi)
    if not planar:
        return turned(rng, t, turn)
    cos, sin = np.cos(turn), np.sin(turn) * rng.choice([-1, 1])
    return np.array([cos * t[0] - sin * t[1], sin * t[0] + cos * t[1], 0.0])


# --- dense sampling -----------------------------------------------------------------------------------------


def polygon(point: Callable[[np.ndarray], np.ndarray], u: np.ndarray, sagitta: float) -> np.ndarray:
    """A polygon so near to a curve, from parameters halved where it is not."""
    for _ in range(40):
        p, step, coarse = point(u), np.diff(u), np.zeros(len(u) - 1, dtype=bool)
        for share in (0.31, 0.5, 0.73):
            coarse |= to_edge(point(u[:-1] + share * step), p[:-1], p[1:]) > sagitta
        coarse &= step > 1e-13 * (u[-1] - u[0])
        if not coarse.any():
            break
        u = np.sort(np.append(u, (u[:-1] + 0.5 * step)[coarse]))
    return p


def to_edge(x: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance from x to the straight line from a to b, each (*batch, 3)."""
    square = np.maximum(((b - a) ** 2).sum(-1), 1e-300)
    share = np.clip(((x - a) * (b - a)).sum(-1) / square, 0, 1)
    return np.linalg.norm(x - a - share[..., None] * (b - a), axis=-1)


def brute(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance from x (N, 3) to the polygon through points, edge by edge."""
    return np.array([to_edge(one, points[:-1], points[1:]).min() for one in x])


def traced(curves: Sequence[ToolCurve], sagitta: float) -> np.ndarray:
    """The polygon along curves one after another."""
    return _apart([polygon(c.position, np.unique(np.append(c.knots, _between(c))), sagitta) for c in curves])


def drawn(contour: Contour, sagitta: float) -> np.ndarray:
    """The polygon along a contour."""
    u = np.linspace(0, 1, 129)
    return _apart([s.points if isinstance(s, Polyline) else polygon(s.point, u, sagitta) for s in contour.segments])


def hausdorff(contour: Contour, curves: Sequence[ToolCurve], sagitta: float) -> float:
    """Hausdorff distance of a contour and curves, accurate to two of ``sagitta``."""
    drawing, trace = drawn(contour, sagitta), traced(curves, sagitta)
    along = np.concatenate([np.linspace(0, 1, 9), 10.0 ** np.arange(-5, -1), 1 - 10.0 ** np.arange(-5, -1)])
    dense = (drawing[:-1, None] + along[:, None] * np.diff(drawing, axis=0)[:, None]).reshape(-1, 3)
    return max(Polyline(drawing).distance(trace).max(), Polyline(trace).distance(dense).max())


def _between(curve: ToolCurve) -> np.ndarray:
    return (curve.knots[:-1] + np.diff(curve.knots) * np.linspace(0.2, 0.8, 4)[:, None]).reshape(-1)


def _apart(parts: Sequence[np.ndarray]) -> np.ndarray:
    points = np.concatenate(parts)
    return points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=-1) > 2e-10)]
