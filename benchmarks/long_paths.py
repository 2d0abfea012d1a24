"""Projection on paths of 10² to 10⁵ segments: time per query, locally from where one was and globally.

Run it with: python benchmarks/long_paths.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from pathcontrol import WaypointPath

QUERIES, EACH, SPACING = 200, 100, 0.002


def zigzag(segments: int) -> WaypointPath:
    """Parallel passes of a hundred waypoints, 0.002 rad apart."""
    passes = segments // EACH
    x, y = np.broadcast_arrays(np.linspace(0, 1, EACH), SPACING * np.arange(passes)[:, None])
    points = np.stack([x, y], axis=-1).copy()
    points[1::2] = points[1::2, ::-1]
    return WaypointPath(points.reshape(-1, 2), 1.0)


def per_call(function: Callable[[int], object]) -> float:
    """Median time of a call [µs]."""
    times = []
    for i in range(QUERIES):
        began = time.perf_counter()
        function(i)
        times.append(time.perf_counter() - began)
    return 1e6 * float(np.median(times))


def measured(segments: int) -> dict[str, float]:
    path, rng = zigzag(segments), np.random.default_rng(0)
    s = rng.uniform(*path.one_traverse, size=QUERIES)
    q = path.q_d(s) + 0.01 * rng.normal(size=(QUERIES, 2))
    began = time.perf_counter()
    path.sigma_bar(q[0])
    return {
        "index [ms]": 1e3 * (time.perf_counter() - began),
        "path [us]": per_call(lambda i: path.q_d(s[i])),
        "local [us]": per_call(lambda i: path.sigma_bar(q[i], near=s[i])),
        "global [us]": per_call(lambda i: path.sigma_bar(q[i])),
    }


def main() -> None:
    rows = {segments: measured(segments) for segments in (10**2, 10**3, 10**4, 10**5)}
    shortest = rows[10**2]
    print(f"{'segments':>9}" + "".join(f"{name:>14}{'ratio':>7}" for name in shortest))
    for segments, row in rows.items():
        cells = (f"{value:14.1f}{value / shortest[name]:7.2f}" for name, value in row.items())
        print(f"{segments:9d}" + "".join(cells))


if __name__ == "__main__":
    main()
