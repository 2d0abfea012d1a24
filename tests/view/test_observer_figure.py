"""The figure of what pushes the arm: the observer's numbers, in a figure and in reports of runs that were pushed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pathcontrol import (
    Circle,
    ControlLoop,
    Envelope,
    InputError,
    Line,
    Projection,
    Push,
    Run,
    figures,
    load_robot,
    momentum_observer,
    observer_figure,
    simulate,
)
from pathcontrol.view.report.pictures import _has_more_to_see, pictures

CAPTION = "Torques beside those of motors and friction"
RAIL = load_robot(
    """<robot name="rail"><link name="base"/>
    <link name="carriage"><inertial><mass value="2"/>
    <inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial></link>
    <joint name="slide" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""
)


def pushed(arm, disturbance=None, rows=1, plant=None) -> Run:
    law = Projection(arm, Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    start = [[0.7, 1.2]] * rows
    return simulate(law, start, duration=0.4, plant=plant, disturbance=disturbance, progress=False)


@pytest.fixture(scope="module")
def runs(arm) -> dict[str, Run]:
    loaded = pushed(arm, plant=arm.with_payload(2.0, "tool"))
    return {"pushed": pushed(arm, Push([20.0, 5.0], 0.1, 0.1)), "alone": pushed(arm), "loaded": loaded}


@pytest.mark.parametrize("friction", ["none", "full"])
def test_each_joint_has_the_estimates_of_all_runs(runs, friction):
    panels = observer_figure(runs, cutoff_hz=10.0, friction=friction).axes
    assert len(panels) == 2
    for j, axes in enumerate(panels):
        for line, run in zip(axes.lines[1:], runs.values(), strict=True):
            assert_allclose(line.get_xdata(), run.time)
            assert_allclose(line.get_ydata(), momentum_observer(run, cutoff_hz=10.0, friction=friction)[0, :, j])
    assert panels[1].get_ylabel() == "$r_{2}$ [N m]"
    assert figures.observer_figure is observer_figure


def test_one_of_many_rollouts_is_drawn(arm):
    run = pushed(arm, Push([[0.0, 0.0], [20.0, 5.0]], 0.1), rows=2)
    drawn = observer_figure(run, rollout=1).axes[0].lines[1].get_ydata()
    assert_allclose(drawn, momentum_observer(run)[1, :, 0])
    with pytest.raises(InputError, match="rollout 2"):
        observer_figure(run, rollout=2)


def test_a_joint_that_slides_is_pushed_by_a_force():
    law = Projection(RAIL, Line([0.0], [1.0], 1.0), 400.0, 40.0)
    run = simulate(law, [0.0], duration=0.3, disturbance=Push([3.0]), progress=False)
    (axes,) = observer_figure(run).axes
    assert axes.get_ylabel() == "$r_{1}$ [N]"
    assert axes.lines[1].get_ydata()[-1] == pytest.approx(3.0, rel=1e-6)


def logged(arm) -> Run:
    loop = ControlLoop(
        Projection(arm, Circle(1.0, 2.0), 800.0, 45.0), 2.5e-3, Envelope(velocity=9.0, lower=-9.0, upper=9.0)
    )
    with loop.record() as log:
        for k in range(5):
            loop.step([1.0, 0.0], [0.0, 0.0], 2.5e-3 * k)
    return log.run()


def test_reports_of_pushed_runs_have_it(runs, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.pictures._draw", lambda figure: ("png", b""))  # captions are enough

    def captions(*names):
        return [one.caption for one in pictures({name: runs[name] for name in names})]

    assert CAPTION in captions("alone", "pushed")
    assert CAPTION not in captions("alone")


def test_so_have_those_of_other_arms_and_of_logs(arm, runs):
    assert all(map(_has_more_to_see, (runs["loaded"], logged(arm))))
    assert not _has_more_to_see(runs["alone"])


@pytest.mark.filterwarnings("ignore::pathcontrol.PathControlWarning")
def test_a_rollout_that_diverges_has_a_gap(arm):
    run = pushed(arm, Push([[0.0, 0.0], [1e9, 0.0]], 0.1), rows=2)
    drawn = observer_figure(run, rollout=1).axes[0].lines[1].get_ydata()
    assert np.isnan(drawn[-1])
    assert np.isfinite(drawn[1])
