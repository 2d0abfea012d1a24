"""Round-off and overshoot at corners: synthetic passes give their closed forms."""

import json

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.compared_space import ComparedSpace
from pathcontrol.analysis.lap_accuracy.accuracy_table import accuracy_table
from pathcontrol.analysis.lap_accuracy.cornering import find_corners
from pathcontrol.toolpaths.segments.segment import Polyline

ARM = pc.load_robot("cicese_2dof")
PERIOD = 2.5e-3


class Corner(pc.PathTask):
    """An open path that bends by ``turn`` along a fillet of a given radius: it stands for two legs of length 1."""

    def __init__(self, radius, turn=np.pi / 2, start=(0.0, 0.0)):
        self.radius, self.turn, self.start = radius, turn, np.array(start)
        self.cut = radius * np.tan(turn / 2)  # of each leg

    n, s0, period = 2, 0.0, None

    @property
    def s_end(self):
        return 2 * (1 - self.cut) + self.radius * self.turn

    def parts(self, s):
        """Return positions and unit tangents."""
        angle = np.clip((s - (1 - self.cut)) / self.radius, 0.0, self.turn)
        first = np.minimum(s, 1 - self.cut)
        last = np.maximum(s - (1 - self.cut) - self.radius * self.turn, 0.0)
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        x = first + self.radius * np.sin(angle) + last * np.cos(self.turn)
        y = self.radius * (1 - np.cos(angle)) + last * np.sin(self.turn)
        return self.start + np.stack([x, y], axis=-1), tangent

    def q_d(self, s):
        return self.parts(np.asarray(s))[0]

    def dq_d(self, s):
        return self.parts(np.asarray(s))[1]

    def theta(self, s):
        return np.ones(np.shape(s))

    def legs(self):
        """Return the three points of the polyline that it stands for."""
        corner = self.start + np.array([1.0, 0.0])
        return np.stack([self.start, corner, corner + np.array([np.cos(self.turn), np.sin(self.turn)])])


def passes(task, *motions, margin=0.2):
    """A run with one rollout for each motion x(t), v(t), which begins before the path does and ends after it."""
    t = np.arange(0.0, task.s_end + 2 * margin, PERIOD)
    x, v = (np.stack(parts) for parts in zip(*(motion(t - margin) for motion in motions), strict=True))
    s = np.broadcast_to(np.clip(t - margin, 0.0, task.s_end), x.shape[:2])
    return run_of(t, x, v, s, task)


def run_of(t, x, v, s, task):
    """A run of such positions, velocities and path parameters, (N, K, …) each."""
    arrays = {"q": x, "qd": v, "s": np.array(s)}
    return pc.Run.from_arrays(t, {"joint_1": "rad", "joint_2": "rad"}, arrays, {}, robot=ARM, task=task)


def along(task, shift=(0.0, 0.0)):
    """The motion along another such path, which goes on straight before and after it."""

    def motion(t):
        x, v = task.parts(t)
        return x + np.array(shift), v

    return motion


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_a_fillet_of_a_right_angle_rounds_off_by_its_closed_form(radius):
    task = Corner(radius)
    found = pc.accuracy(passes(task, along(task)), polyline=task.legs(), sections=20)
    assert found.cornering_round_off == pytest.approx(radius * (np.sqrt(2) - 1), abs=1e-9)
    assert found.cornering_overshoot == pytest.approx(0.0, abs=1e-9)
    assert found.corners[0].turn == pytest.approx(np.pi / 2)
    np.testing.assert_array_equal(found.corners[0].point, [1.0, 0.0])


@pytest.mark.parametrize("turn", np.deg2rad([46.0, 60.0, 120.0, 140.0]))
def test_a_fillet_of_any_angle_rounds_off_by_its_closed_form(turn):
    """The centre is r/cos(θ/2) away from the corner."""
    task = Corner(0.1, turn)
    found = pc.accuracy(passes(task, along(task)), polyline=task.legs(), sections=20)
    assert found.cornering_round_off == pytest.approx(0.1 * (1 / np.cos(turn / 2) - 1), abs=1e-9)


def swing(task, size, width=0.1):
    """The exact legs, and after the corner a swing beyond the second one that is ``size`` at a distance ``width``."""

    def motion(t):
        w = t - 1.0  # along the second leg
        bump = size * (w / width) * np.exp(1 - w / width)
        slope = size / width * (1 - w / width) * np.exp(1 - w / width)
        here = (w > 0)[:, None]
        first = np.stack([t, np.zeros_like(t)], axis=-1), np.tile([1.0, 0.0], (len(t), 1))
        then = np.stack([1.0 + bump, w], axis=-1), np.stack([slope, np.ones_like(t)], axis=-1)
        x, v = (np.where(here, after, before) for before, after in zip(first, then, strict=True))
        return task.start + x, v

    return motion


def test_a_known_overshoot_is_found():
    task = Corner(1e-3)
    found = pc.accuracy(passes(task, swing(task, 0.02)), polyline=task.legs(), sections=20)
    assert found.cornering_overshoot == pytest.approx(0.02, abs=1e-9)
    assert found.cornering_round_off < 3e-3


def test_a_swing_to_the_inner_side_is_no_overshoot():
    task = Corner(1e-3)
    found = pc.accuracy(passes(task, swing(task, -0.02)), polyline=task.legs(), sections=20)
    assert found.cornering_overshoot < 5e-4  # the cubic across the sharp bend between two samples


def test_several_passes_count_by_their_mean():
    """Fillets of radii r_j cross the bisector at r_j(√2 − 1), and swings by o_j have the mean of them."""
    radii, task = np.array([0.05, 0.08, 0.14]), Corner(0.05)
    found = pc.accuracy(passes(task, *(along(Corner(r)) for r in radii)), polyline=task.legs(), sections=20)
    assert found.cycles == 3
    assert found.cornering_round_off == pytest.approx(radii.mean() * (np.sqrt(2) - 1), abs=1e-9)
    task = Corner(1e-3)
    found = pc.accuracy(passes(task, swing(task, 0.03), swing(task, 0.01)), polyline=task.legs(), sections=20)
    assert found.cornering_overshoot == pytest.approx(0.02, abs=1e-9)
    assert np.isfinite(found.path_repeatability)


def test_passes_on_both_sides_of_a_corner_have_a_mean_that_goes_through_it():
    task = Corner(0.05)
    out = np.array([0.01, -0.01])  # away from the corner, along its bisector
    shifts = [radius * (1 - 1 / np.sqrt(2)) * np.array([1.0, -1.0]) for radius in (0.05, 0.05)]
    run = passes(task, along(task, shifts[0] + out), along(task, shifts[1] - out))
    found = pc.accuracy(run, polyline=task.legs(), sections=20)
    assert found.cornering_round_off == pytest.approx(0.0, abs=1e-9)


def rounded_square(radius, side=0.6):
    """A closed square with fillets, as a function of its arc length, and the square."""
    edge, arc = side - 2 * radius, radius * np.pi / 2
    period = 4 * (edge + arc)

    def position(s):
        s = np.asarray(s) % period
        k = np.floor(s / (edge + arc))
        w = s - k * (edge + arc)
        angle = np.clip((w - edge) / radius, 0.0, np.pi / 2)
        local = np.stack([np.minimum(w, edge) + radius * np.sin(angle), radius * (1 - np.cos(angle))], axis=-1)
        local = local - [side / 2 - radius, side / 2]
        c, o = np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)
        return np.stack([c * local[..., 0] - o * local[..., 1], o * local[..., 0] + c * local[..., 1]], axis=-1)

    half = side / 2
    return position, period, np.array([[-half, -half], [half, -half], [half, half], [-half, half]])


def test_every_corner_of_a_closed_square_counts_in_every_lap():
    radius = 0.1
    position, period, square = rounded_square(radius)
    task = pc.FunctionPath(position, 1.0, period=period)
    t = np.arange(0.0, 2.6 * period, PERIOD)
    v = (position(t + 1e-6) - position(t - 1e-6)) / 2e-6
    found = pc.accuracy(run_of(t, position(t)[None], v[None], t[None], task), polyline=square, skip=0, sections=20)
    assert found.cycles == 2
    np.testing.assert_allclose(found.round_off, radius * (np.sqrt(2) - 1), atol=1e-7)  # of differences of numbers
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert len(told["corners"]) == 4
    assert told["corners"][0]["point"] == square[1].tolist()
    assert told["cornering_round_off"] == pytest.approx(radius * (np.sqrt(2) - 1), abs=1e-7)
    assert found.path_accuracy < 1e-7


def test_waypoints_are_corners_where_they_turn_enough():
    points = np.array([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0], [0.5, 1.0]])
    task = pc.WaypointPath(points, speed=0.5, closed=True)
    law = pc.Projection(ARM, task, 800.0, [45.0, 100.0], friction="full")
    run = pc.simulate(law, points[0], duration=15.0, laps=3, progress=False)
    found = pc.accuracy(run)
    assert len(found.corners) == 4
    assert found.cornering_round_off < 5e-3  # the spline goes through its waypoints
    heads = [row[0] for row in accuracy_table(run)]
    assert "cornering round-off, largest of 4 corners" in heads
    assert "cornering overshoot, largest of 4 corners" in heads
    profiled = pc.accuracy(run, path.with_profile(pc.ConstantRate(1.0)) if (path := run.task) is not None else None)
    assert len(profiled.corners) == 4
    angle = np.arange(12) * np.pi / 6
    twelve = pc.WaypointPath(np.stack([np.cos(angle), np.sin(angle)], axis=-1), 0.5, closed=True)
    assert find_corners(twelve, ComparedSpace(None), None) == []


def test_a_smooth_path_has_none_and_says_so():
    law = pc.Projection(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    run = pc.simulate(law, [1.0, 0.0], duration=8.0, progress=False)
    told = pc.accuracy(run).to_dict()
    assert told["corners"] == []
    assert told["cornering_round_off"] is None
    assert told["cornering_overshoot"] is None
    assert not any("corner" in row[0] for row in accuracy_table(run))


@pytest.mark.parametrize(
    ("polyline", "told"),
    [([[0.0, 0.0], [1.0, 0.0]], "shape"), ([[0.0], [1.0], [2.0]], "shape"), ([[0, 0], [1, 0], [1, 0]], "same point")],
)
def test_a_polyline_that_is_none_is_told(polyline, told):
    task = Corner(0.1)
    with pytest.raises(pc.InputError, match=told):
        pc.accuracy(passes(task, along(task)), polyline=polyline)


def test_corners_of_a_toolpath_are_rounded_by_no_more_than_its_tolerance_and_what_the_arm_errs():
    """A square of 40 mm: the arm begins and ends at one of its corners, and passes three."""
    side = 0.04 * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]])
    drawing = pc.Toolpath((pc.Contour((Polyline(side),), closed=True, feed=0.1),))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [0.3, -0.05, 0.65]
    arm = ARM.with_frame("pen", "tool", [0.0, 0.0, -0.05])
    task = pc.ToolpathTask(arm, "pen", drawing, pose, tolerance=5e-4, clearance=0.0)
    law = pc.Projection(arm, task, 800.0, [45.0, 100.0], friction="full")
    run = pc.simulate(law, task.q_d(np.array(task.s0)), duration=8.0, progress=False)
    found = pc.accuracy(run)
    assert (found.unit, len(found.corners)) == ("m", 3)
    assert (found.round_off > 1e-4).all()
    assert found.cornering_round_off < 5e-4 + found.path_accuracy
    assert found.cornering_overshoot <= found.path_accuracy + 1e-6


def test_a_saved_run_knows_the_corners_of_its_path(tmp_path):
    points = np.array([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0], [0.5, 1.0]])
    task = pc.WaypointPath(points, speed=1.0, closed=True, tolerance=0.02)
    run = pc.simulate(pc.Projection(ARM, task, 800.0, 57.0), task.q_d(np.array(0.0)), duration=8.0, progress=False)
    saved = pc.Run.load(run.save(tmp_path / "square.nc"))
    np.testing.assert_allclose(pc.accuracy(saved).round_off, pc.accuracy(run).round_off, atol=1e-9)
    assert len(pc.accuracy(saved).corners) == 4


def test_the_corners_of_a_tools_polyline_are_in_metres():
    arm = ARM.with_frame("pen", "tool", [0.0, 0.0, -0.05])
    plane = arm.frame_pose(np.zeros(2), "pen")[1, 3]
    points = [[0.35, plane, 0.6], [0.4, plane, 0.6], [0.4, plane, 0.65]]
    path = pc.CartesianPath(arm, "pen", pc.ToolCurve.polyline(points, tolerance=5e-4), speed=0.05)
    run = pc.simulate(
        pc.Projection(arm, path, 800.0, 57.0, friction="full"), path.start_posture, duration=4.0, progress=False
    )
    found = pc.accuracy(run)
    assert (found.unit, len(found.corners)) == ("m", 1)
    assert 3e-4 < found.cornering_round_off < 1e-3
    assert pc.accuracy(run, frame="tool").corners == ()
