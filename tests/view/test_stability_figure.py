"""The figure of a gain map: the boundary is drawn where it was found, and gains are marked where they are."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import pathcontrol as pc
from pathcontrol.analysis.stability.stability_map import StabilityMap
from pathcontrol.errors import InputError, UnknownNameError

X, Y = np.geomspace(1.0, 1e4, 5), np.array([1.0, 2.0, 3.0])


def made(rates, boundary, segments, own=(10.0, 2.5)):
    grids, names = (X, Y)[: rates.ndim], ("k", "K_p")[: rates.ndim]
    shape = (-1, rates.ndim)
    return StabilityMap(
        names,
        grids,
        -rates,
        np.exp(-rates),
        np.array(boundary, dtype=float).reshape(shape),
        np.array(segments, dtype=np.intp).reshape(-1, 2),
        ("1/rad^2/s", "1/s^2")[: rates.ndim],
        own[: rates.ndim],
        "ExtendedMotionPlan",
        None,
    )


PLANE = np.repeat([[3.0], [3.0], [2.0], [-1.0], [-2.0]], 3, axis=1)
LINE = [[700.0, 1.0], [650.0, 2.0], [600.0, 3.0]]


def test_the_boundary_and_the_own_gains_are_where_they_are():
    figure = pc.stability_figure(made(PLANE, LINE, [[0, 1], [1, 2]]))
    axes = figure.axes[0]
    lines = next(one for one in axes.collections if isinstance(one, LineCollection)).get_segments()
    np.testing.assert_allclose(lines, [LINE[:2], LINE[1:]])
    assert axes.get_xscale() == "log"
    assert axes.get_yscale() == "linear"
    star = next(line for line in axes.lines if line.get_marker() == "*")
    assert star.get_xydata().tolist() == [[10.0, 2.5]]
    assert "k [1/rad²/s]" in axes.get_xlabel().replace("\\", "")
    figure.savefig("/dev/null", format="png")


@pytest.mark.parametrize("rates", [PLANE, -np.abs(PLANE), np.abs(PLANE), PLANE[:, 0]])
def test_maps_of_any_kind_are_drawn(rates):
    boundary = LINE if rates is PLANE else [700.0] if rates.ndim == 1 else []
    for mark in (None, {}, {"k": 100.0, "K_p": 1.0} if rates.ndim == 2 else {"k": 100.0}):
        figure = pc.stability_figure(made(rates, boundary, []), mark=mark)
        stars = [line for line in figure.axes[0].lines if line.get_marker() == "*"]
        assert len(stars) == (mark != {})


def test_what_is_not_on_the_map_is_not_marked():
    far = made(PLANE, LINE, [[0, 1], [1, 2]], own=(1e6, 2.0))
    apart = made(PLANE, LINE, [[0, 1], [1, 2]], own=(20.0, None))
    for one in (far, apart):
        assert not [line for line in pc.stability_figure(one).axes[0].lines if line.get_marker() == "*"]
    with pytest.raises(UnknownNameError, match="did you mean 'K_p'"):
        pc.stability_figure(far, mark={"k_p": 3.0})
    with pytest.raises(InputError, match="StabilityMap"):
        pc.stability_figure(PLANE)
