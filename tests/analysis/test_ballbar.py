"""The radial error round a circle: closed forms, and spikes where joints turn back."""

import json
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import InputError

ARM = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)


@cache
def round_trip(friction="viscous"):
    law = pc.ExtendedMotionPlan(ARM, CIRCLE, K_p=800.0, K_v=[45.0, 100.0], k=20.0, friction=friction)
    return pc.simulate(law, [1.0, 0.0], duration=8.0, progress=False)


def test_a_moved_circle_and_an_ellipse_have_their_closed_forms():
    t = np.arange(0.0, 7.0, 2.5e-3)
    for radii, offset in (((1.0, 1.0), (0.03, -0.02)), ((1.02, 0.99), (0.0, 0.0))):
        points = np.array(offset) + np.array(radii) * np.stack([np.cos(2 * t), np.sin(2 * t)], axis=-1)
        run = pc.Run.from_log(t, points, robot=ARM, task=CIRCLE)
        found = pc.ballbar(run)
        exact = np.linalg.norm(points, axis=-1) - 1
        assert found.radius == pytest.approx(1.0, abs=1e-12)
        assert found.error.max() == pytest.approx(exact.max(), abs=1e-5)
        at = found.angle - 2 * np.pi * np.floor(found.angle / (2 * np.pi))
        radius = np.interp(at, *_polar(radii, offset))
        np.testing.assert_allclose(found.error, radius - 1, atol=1e-6)


def _polar(radii, offset):
    """The angle and the radius of a moved ellipse, finely."""
    place = np.linspace(-0.5, 7.0, 200_001)
    x, y = (c + r * f(place) for c, r, f in zip(offset, radii, (np.cos, np.sin), strict=True))
    return np.unwrap(np.arctan2(y, x)), np.hypot(x, y)


def test_spikes_are_only_where_a_joint_turns_back():
    """Coulomb friction that is not compensated jumps where a joint comes to rest and where it leaves.

    With it the second derivative of the radial error jumps, so that third differences over time have a spike there.
    """
    run = round_trip()
    found = pc.ballbar(run)
    jumps = np.abs(np.diff(found.error, 3))
    peaks = (jumps[1:-1] > np.maximum(jumps[:-2], jumps[2:])) & (jumps[1:-1] >= 0.2 * jumps.max())
    spikes = np.flatnonzero(peaks) + 1
    still = np.abs(_counted(run, found)).min(1) < 0.02  # rad/s, of some joint
    assert len(spikes) >= len(found.reversal) >= 3
    assert all(still[max(k - 2, 0) : k + 6].any() for k in spikes)
    # and every reversal has one
    beside = np.abs(found.angle[spikes][:, None] - found.reversal).min(0)
    assert (beside < 0.2).all()


def _counted(run, found):
    """The joint velocities at the samples of a ballbar."""
    s = run.array("s")[0]
    laps = (s - s[0]) / (2 * np.pi)
    counted = np.flatnonzero((laps >= 1) & (laps <= int(laps.max())))
    assert len(counted) == len(found.angle)
    return run.array("qd")[0][counted]


def test_joints_of_a_circle_turn_back_twice_a_lap_each():
    found = pc.ballbar(round_trip())
    laps = (found.angle[-1] - found.angle[0]) / (2 * np.pi)
    for joint in (0, 1):
        assert abs((found.reversing == joint).sum() - 2 * laps) <= 1
    with pytest.raises(InputError, match="laps"):
        pc.ballbar(round_trip(), skip=5)


def test_what_is_no_circle_is_told():
    task = pc.Lissajous([0.3, 0.3], [1, 2], speed=0.5)
    law = pc.Projection(ARM, task, 800.0, [45.0, 100.0])
    run = pc.simulate(law, [0.3, 0.0], duration=1.0, progress=False)
    with pytest.raises(InputError, match="no circle"):
        pc.ballbar(run)
    with pytest.raises(InputError, match="no circle in 'tool'"):
        pc.ballbar(round_trip(), frame="tool")


def test_figures_and_reports_show_it(tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.pictures._draw", lambda figure: ("png", b""))
    run = round_trip()
    figure = pc.ballbar_figure({"one": run, "two": round_trip("full")})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["one", "two"]
    figure.canvas.draw()
    run.save(tmp_path / "run.nc")
    done = CliRunner().invoke(main, ["report", str(tmp_path / "run.nc"), "--out", str(tmp_path / "r.html"), "--json"])
    assert done.exit_code == 0, done.output
    (told,) = json.loads(done.stdout)["accuracy"].values()
    assert told == json.loads(json.dumps(pc.accuracy(run).to_dict()))
    page = (tmp_path / "r.html").read_text()
    assert "Radial error round the circle" in page
    assert "path accuracy AT" in page
