"""Figures of sweeps show every sample, in the units a person reads."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pathcontrol import UnknownNameError, basin_figure, robustness_figure, save_figure
from pathcontrol.errors import InputError

pytest.importorskip("pyarrow")


def table(lost=()):
    q = np.stack(np.meshgrid(np.linspace(-1, 1, 6), np.linspace(0, 2, 5), indexing="ij"), -1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    status = np.full(30, "running", dtype=object)
    error = rng.uniform(0.1, 1.0, 30)
    status[list(lost)], error[list(lost)] = "diverged", np.nan
    return xr.Dataset(
        {"status": ("sample", status.astype(str)), "e_p_peak": ("sample", error, {"units": "rad"})},
        {"sample": np.arange(30), "q": (("sample", "q component"), q), "k": ("sample", rng.uniform(1, 9, 30))},
    )


@pytest.mark.parametrize("lost", [(), (0, 7, 8)])
def test_a_basin_has_a_point_for_each_sample_and_a_cross_for_each_that_diverged(lost, tmp_path):
    data = table(lost)
    figure = basin_figure(data, "q[0]", "q[1]", "e_p_peak")
    axes = figure.axes[0]
    known = ~np.isnan(data["e_p_peak"].to_numpy())
    np.testing.assert_allclose(axes.collections[0].get_array(), np.rad2deg(data["e_p_peak"].to_numpy()[known]))
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), data["q"].to_numpy()[known])
    assert len(axes.lines[0].get_xdata()) == len(lost)
    assert "[deg]" in figure.axes[1].get_ylabel()
    assert all(file.stat().st_size for file in save_figure(figure, tmp_path / "basin"))


def test_over_a_grid_the_spread_is_that_of_each_value():
    data = table(lost=(0, 7))
    figure = robustness_figure(data, "q[0]", "e_p_peak")
    middle, worst = figure.axes[0].lines
    groups = np.rad2deg(data["e_p_peak"].to_numpy()).reshape(6, 5)
    np.testing.assert_allclose(middle.get_xdata(), np.linspace(-1, 1, 6))
    np.testing.assert_allclose(middle.get_ydata(), np.nanmedian(groups, axis=1))
    np.testing.assert_allclose(worst.get_ydata(), np.nanmax(groups, axis=1))
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), [20, 20, 0, 0, 0, 0])


def test_over_a_distribution_every_sample_is_in_one_bin():
    data = table()
    figure = robustness_figure(data, "k", "e_p_peak")
    worst = figure.axes[0].lines[1].get_ydata()
    assert len(figure.axes) == 1
    assert len(worst) == 6
    assert worst.max() == np.rad2deg(float(data["e_p_peak"].max()))
    assert (np.diff(figure.axes[0].lines[0].get_xdata()) > 0).all()


def test_what_never_settles_is_shown():
    data = table(lost=(0,))
    data["e_p_peak"][[7, 8, 29]] = np.inf
    crosses, circles = basin_figure(data, "q[0]", "q[1]", "e_p_peak").axes[0].lines
    assert len(crosses.get_xdata()) == 1
    np.testing.assert_array_equal(circles.get_xydata(), data["q"].to_numpy()[[7, 8, 29]])
    spread = robustness_figure(data, "q[0]", "e_p_peak")
    np.testing.assert_allclose(spread.axes[1].lines[0].get_ydata(), [20, 40, 0, 0, 0, 20])
    assert np.isfinite(spread.axes[0].lines[1].get_ydata()).all()


def test_wide_values_have_logarithmic_scales():
    data = table()
    data = data.assign_coords(k=("sample", np.geomspace(1.0, 1e4, 30)))
    data["e_p_peak"] = ("sample", np.geomspace(1.0, 100.0, 30))
    axes, bar = basin_figure(data, "k", "q[1]", "e_p_peak").axes
    assert (axes.get_xscale(), axes.get_yscale(), bar.get_yscale()) == ("log", "linear", "log")
    [axes] = robustness_figure(data, "k", "e_p_peak").axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_what_is_not_there_is_told():
    with pytest.raises(UnknownNameError, match=r"parameter 'q': expected one of q\[0\], q\[1\], k"):
        basin_figure(table(), "q", "k", "e_p_peak")
    with pytest.raises(UnknownNameError, match="metric 'contour_error_peak': expected one of e_p_peak"):
        robustness_figure(table(), "k")
    with pytest.raises(InputError, match="expected a SweepResult or its table"):
        robustness_figure(3, "k")
