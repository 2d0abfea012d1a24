"""The reach of paths against closed forms and brute force, in the space of the joints and of the tool."""

import numpy as np
import pytest
from sliding_arm import sliding_arm

import pathcontrol as pc
from pathcontrol.errors import InputError, TaskError

ARM, SLIDES = pc.load_robot("cicese_2dof"), sliding_arm()


class Curve(pc.PathTask):
    """A path by a function of s, closed unless it is given an end."""

    def __init__(self, function, period=2 * np.pi, end=None):
        self.function = function
        self.period, self.s_end = (period, np.inf) if end is None else (None, end)

    def q_d(self, s):
        return np.stack(self.function(np.asarray(s)), axis=-1)

    def theta(self, s):
        return np.ones_like(s)


def polar(radius):
    return Curve(lambda s: (radius(s) * np.cos(s), radius(s) * np.sin(s)))


def brute(task, count=400):
    """The infimum of Federer's F over samples, which the reach is at most, to second order."""
    s = np.linspace(*task.one_traverse, count, endpoint=False)
    points, slope = task.q_d(s), task.dq_d(s)
    tangent = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    chord = points[None] - points[:, None]
    along = (chord * tangent[:, None]).sum(-1)
    away = np.linalg.norm(chord - along[..., None] * tangent[:, None], axis=-1)
    np.fill_diagonal(away, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nanmin(np.where(away > 0, (chord**2).sum(-1) / (2 * away), np.inf))


@pytest.mark.parametrize("radius", [0.2, 1.3])
def test_a_circle_has_its_radius(radius):
    found = pc.reach(pc.Circle(radius, 2.0))
    assert (found.value, found.limit, found.unit, found.tool) == (
        pytest.approx(radius, rel=1e-12),
        "curvature",
        "rad",
        None,
    )
    assert found.radius == found.value
    assert found.bottleneck == np.inf


@pytest.mark.parametrize(("a", "b"), [(2.0, 0.7), (0.5, 1.0), (2.0, 0.5)])
def test_an_ellipse_has_b_squared_over_a(a, b):
    """The curvature at the ends of the longer axis limits it, before half the shorter one does."""
    found = pc.reach(pc.Ellipse([a, b], 1.0))
    assert found.value == pytest.approx(min(a, b) ** 2 / max(a, b), rel=1e-9)
    assert found.limit == "curvature"
    at = np.abs(pc.Ellipse([a, b], 1.0).q_d(np.array(found.s)))
    assert at[np.argmax([a, b])] == pytest.approx(max(a, b), rel=1e-6)


def test_a_figure_eight_has_none():
    path = pc.Lissajous([1.0, 0.5], [1, 2], speed=1.0)
    found = pc.reach(path)
    assert (found.value, found.limit) == (0.0, "bottleneck")
    np.testing.assert_allclose(path.q_d(np.array(found.s)), path.q_d(np.array(found.other)), atol=1e-9)
    assert abs(found.s - found.other) > 0.1


@pytest.mark.parametrize("gap", [0.1, 0.01])
def test_two_strands_have_half_their_distance(gap):
    """A curve twice around: at s and s + 2π it is 2·gap from itself, normal to both strands, everywhere."""
    coil = Curve(
        lambda s: ((1 + gap * np.cos(s / 2)) * np.cos(s), (1 + gap * np.cos(s / 2)) * np.sin(s), gap * np.sin(s / 2)),
        period=4 * np.pi,
    )
    found = pc.reach(coil)
    assert found.value == pytest.approx(gap, rel=1e-9)
    assert found.limit == "bottleneck"
    assert abs(found.other - found.s) == pytest.approx(2 * np.pi, abs=1e-3)
    assert found.radius > 0.5


@pytest.mark.parametrize("waist", [0.2, 0.1])
def test_an_hourglass_has_half_its_waist(waist):
    path = Curve(lambda s: (2 * np.cos(s), (waist + (1 - waist) * np.cos(s) ** 2) * np.sin(s)))
    found = pc.reach(path)
    assert (found.limit, found.value) == ("bottleneck", pytest.approx(waist, rel=1e-9))
    np.testing.assert_allclose([found.s, found.other], [np.pi / 2, 3 * np.pi / 2], atol=1e-6)
    assert found.value < found.radius


@pytest.mark.parametrize("width", [0.02, 2e-3, 2e-4])
def test_a_bump_narrower_than_the_samples_is_found(width):
    """A bump of a height w² on a circle of radius 1 with r'' = −2h/w² at its top, where κ = 1 + 2 + O(w²)."""
    path = polar(lambda s: 1 + width**2 * np.exp(-((2 * np.sin((s - 1) / 2) / width) ** 2)))
    near = pc.reach(path)
    h = width**2
    radius, second = 1 + h, -2.0
    curvature = (radius**2 - radius * second) / radius**3
    if width >= 2e-3:  # a bump of a height of 4e-8 turns no tangent, and is between samples
        assert near.value == pytest.approx(1 / curvature, rel=1e-4)
        assert near.s == pytest.approx(1.0, abs=1e-3)
    assert near.value <= 1.0 + 1e-9


def test_an_open_path_ends_at_its_ends():
    """An arc of a circle that nearly closes: its ends are a bottleneck; a line has none."""
    arc = Curve(lambda s: (np.cos(s), np.sin(s)), end=2 * np.pi - 0.2)
    found = pc.reach(arc)
    assert (found.limit, found.value) == ("bottleneck", pytest.approx(np.sin(0.1), rel=1e-9))
    assert (found.s, found.other) == (pytest.approx(0.0, abs=1e-6), pytest.approx(2 * np.pi - 0.2, abs=1e-6))
    line = pc.reach(pc.Line([0.0, 0.0], [1.0, 2.0], 0.5))
    assert (line.value, line.limit) == (np.inf, "none")
    assert line.to_dict()["value"] is None


@pytest.mark.parametrize("seed", range(2))
def test_random_paths_have_the_infimum_of_all_touching_circles(seed):
    random = np.random.default_rng(seed)
    amplitude, phase = random.normal(size=(3, 3)) / [1.0, 2.0, 4.0], random.uniform(0, 2 * np.pi, (3, 3))
    order = np.arange(1, 4)
    path = Curve(lambda s: list(np.moveaxis((amplitude * np.cos(order * s[..., None, None] + phase)).sum(-1), -1, 0)))
    found, least = pc.reach(path), brute(path)
    assert found.value <= least * (1 + 1e-9)
    assert found.value == pytest.approx(least, rel=2e-2)
    ends = path.q_d(np.array([found.s, found.other]))
    if found.limit == "bottleneck":  # a chord that is normal at both ends
        chord = ends[1] - ends[0]
        assert np.linalg.norm(chord) == pytest.approx(2 * found.value, rel=1e-6)
        slopes = path.dq_d(np.array([found.s, found.other]))
        assert np.abs(slopes @ chord).max() < 1e-5 * np.linalg.norm(slopes, axis=1).max() * np.linalg.norm(chord)


def test_within_the_reach_the_nearest_point_is_unique():
    """From any point of the path, along any normal, the projection comes back to it up to the reach, and not beyond."""
    path = pc.Ellipse([1.5, 0.8], 1.0)
    found, s = pc.reach(path), np.linspace(0.0, 2 * np.pi, 41)[:-1]
    slope = path.dq_d(s)
    normal = np.stack([-slope[:, 1], slope[:, 0]], axis=-1) / np.linalg.norm(slope, axis=1, keepdims=True)
    for away in (0.99 * found.value, -0.99 * found.value):
        back = path.sigma_bar(path.q_d(s) + away * normal)
        np.testing.assert_allclose(np.cos(back - s), 1.0, atol=1e-9)
    beyond = path.q_d(np.array([found.s])) * (1 - 1.05 * found.value / 1.5)  # towards the middle
    assert np.linalg.norm(path.q_d(path.sigma_bar(beyond)) - beyond) < 1.05 * found.value - 1e-6


def test_the_path_of_the_tool():
    """An arm of slides: the path of its tool is that of its joints, and one of a frame that turns is not."""
    path = pc.Ellipse([0.8, 0.3], 1.0)
    found = pc.reach(path, SLIDES, frame="ly")
    assert (found.unit, found.tool.unit) == ("m", "m")
    assert found.tool.value == pytest.approx(found.value, rel=1e-9)
    assert found.value == pytest.approx(0.09 / 0.8, rel=1e-9)
    assert pc.reach(path, SLIDES).tool is None  # the path was made for none
    path.frame, path.tool_pose = "tool", None
    assert pc.reach(path).tool is None  # its arm is not known
    turn = pc.Line([0.0, 0.3], [2.0, 0.3], 0.5)  # the tip turns about the first joint, on an arc of its distance
    turn.frame, turn.tool_pose = "tool", np.block([[np.eye(3), np.array([[0.0], [0.0], [0.1]])], [np.zeros(3), 1.0]])
    found = pc.reach(turn, ARM)
    x, _, z = (ARM.frame_pose([0.0, 0.3], "tool") @ turn.tool_pose)[:3, 3]
    shoulder = ARM.frame_pose([0.0, 0.3], "joint_1")[2, 3]
    assert found.tool.radius == pytest.approx(np.hypot(x, z - shoulder), rel=1e-9)
    assert (found.limit, found.tool.limit, found.tool.unit) == ("none", "curvature", "m")


def test_what_has_no_reach_says_why():
    with pytest.raises(InputError, match="robot="):
        pc.reach(pc.Circle(1.0, 2.0), frame="tool")
    with pytest.raises(TaskError, match="does not move"):
        pc.reach(Curve(lambda s: (np.sin(s) ** 3, np.cos(s) ** 3)))
    with pytest.raises(TaskError, match="neither ends nor repeats"):
        pc.reach(Curve(lambda s: (s, s), end=np.inf))
    with pytest.raises(InputError, match="joints"):
        pc.reach(pc.Line([0.0], [1.0], 1.0), ARM)
