"""Which branch an arm belongs to: followed by continuity, left only when the arm has been pushed away."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import floats, vectors

from pathcontrol import (
    Circle,
    Ellipse,
    InputError,
    Lissajous,
    PathTask,
    Projection,
    SampledLoop,
    UnknownNameError,
    WaypointPath,
    simulate,
)
from pathcontrol.control.branch import BranchPolicy
from pathcontrol.experiments.schema.derived import section_of
from pathcontrol.registry import LAWS

SPACING, WIDTH, EACH = 0.002, 0.6, 40


def zigzag(passes: int, speed: float = 1.0) -> WaypointPath:
    """Parallel passes along the first joint, ``SPACING`` apart, each of ``EACH`` waypoints."""
    x, y = np.broadcast_arrays(np.linspace(0, WIDTH, EACH), SPACING * np.arange(passes)[:, None])
    points = np.stack([x, y], axis=-1).copy()
    points[1::2] = points[1::2, ::-1]
    return WaypointPath(points.reshape(-1, 2), speed)


def middle_of_pass(path: WaypointPath, i: int) -> float:
    return float(path.parameters[EACH * i + EACH // 2])


def pass_at(path: WaypointPath, s: np.ndarray) -> np.ndarray:
    return np.round(path.q_d(np.asarray(s))[..., 1] / SPACING).astype(int)


def followed(task: PathTask, policy: BranchPolicy, q: np.ndarray, s: float) -> np.ndarray:
    """σ̄ at each of the postures q (T, n), one after the other, from ``s``."""
    found = []
    for x in q:
        there = policy.sigma_bar(task, x, np.asarray(s))
        s = policy.captured(task, x, there, task.q_d(there))
        found.append(float(s))
    return np.array(found)


# --- following ----------------------------------------------------------------------------------------------


def test_an_arm_whose_error_is_larger_than_the_spacing_keeps_its_pass(arm):
    path, one, runs = zigzag(12, speed=3.0), zigzag(2).parameters[EACH], {}
    for branch in ("follow", "local", "nearest"):
        law = Projection(arm, path, 800.0, [45.0, 100.0], branch=branch)
        loop = SampledLoop(torque_limits=True)
        runs[branch] = simulate(law, path.q_d(np.array(0.0)), duration=2.0, loop=loop, progress=False)
    s, skipping = (runs[branch].array("s")[0] for branch in ("follow", "nearest"))
    assert np.array_equal(s, runs["local"].array("s")[0])  # the arm is never farther than the capture distance
    # one pass after the other, over the whole of each
    assert runs["follow"].norm("e_p")[0].max() > 10 * SPACING
    assert np.abs(np.diff(s)).max() < 0.2 * one
    assert s[-1] > 4 * one
    # that of the nearest pass leaves some out
    assert np.diff(skipping).max() > one


@st.composite
def loops(draw: st.DrawFn) -> WaypointPath:
    """A closed path through random waypoints about a circle, which may cross itself."""
    seed, count, n = draw(st.integers(0, 9999)), draw(st.integers(5, 12)), draw(st.integers(2, 4))
    rng, turns = np.random.default_rng(seed), draw(st.integers(1, 2))
    angle = 2 * np.pi * turns * np.arange(count * turns) / (count * turns)
    base = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.concatenate([base, np.zeros((len(base), n - 2))], axis=-1) + 0.1 * rng.normal(size=(len(base), n))
    return WaypointPath(points, 1.0, closed=True)


@settings(max_examples=12)
@given(loops(), st.integers(0, 9999))
def test_random_walks_about_a_path_are_followed_continuously(path, seed):
    """Within the distance d of a curve of curvature κ, the nearest point moves (1 − κd)⁻¹ times as far as the arm."""
    s = np.linspace(path.s0, path.s0 + path.period, 4001)
    speed, bend = np.linalg.norm(path.dq_d(s), axis=-1), np.linalg.norm(path.ddq_d(s), axis=-1)
    radius = (speed**2 / bend).min()  # of curvature, or less
    d, rng = min(0.3 * radius, 0.09), np.random.default_rng(seed)
    t = 1.0 + np.cumsum(rng.normal(size=120)) * 0.02 * radius / speed.max()
    offset = np.cumsum(rng.normal(size=(120, path.n)) * 0.2 * d, axis=0)
    offset *= (d / np.maximum(np.linalg.norm(offset, axis=-1), d))[:, None]
    q = path.q_d(t) + offset
    found = followed(path, BranchPolicy("follow"), q, t[0])
    moved = np.linalg.norm(np.diff(q, axis=0), axis=-1)
    assert (np.abs(np.diff(found)) * speed.min() <= moved / (1 - 0.3) * 1.05 + 1e-12).all()
    # and it is the branch of the point that the arm walks about
    assert (np.linalg.norm(path.q_d(found) - path.q_d(t), axis=-1) <= 2 * d * 1.01).all()


def test_nothing_is_looked_for_within_the_capture_distance():
    class Watched(Ellipse):
        globally = 0

        def sigma_bar(self, q, near=None):
            self.globally += near is None
            return super().sigma_bar(q, near)

    task, t = Watched((1.0, 0.8), 1.0), np.linspace(0.5, 6.0, 100)
    followed(task, BranchPolicy("follow"), 1.09 * task.q_d(t), t[0])
    assert task.globally == 0
    followed(task, BranchPolicy("follow"), 1.2 * task.q_d(t), t[0])
    assert task.globally == 100


# --- pushed away --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("branch", "jumps"), [("follow", 1), ("local", 0), ("nearest", 1)])
def test_pushed_to_another_pass(branch, jumps):
    path = zigzag(300)
    s = middle_of_pass(path, 20)
    ahead = path.q_d(s + np.linspace(0, 0.3, 30))
    pushed = ahead[::-1] + np.array([0.0, 0.5 + SPACING / 5])  # 250 passes away, moving back
    found = followed(path, BranchPolicy(branch), np.concatenate([ahead, pushed]), s)
    passes = pass_at(path, found)
    assert np.count_nonzero(np.diff(passes)) == jumps
    assert passes[0] == 20
    assert passes[-1] == (270 if jumps else 20)


def test_a_push_that_is_smaller_than_the_capture_distance_moves_only_the_nearest():
    path = zigzag(100)
    s = middle_of_pass(path, 20)
    q = path.q_d(np.array([s])) + np.array([0.0, 0.09])
    found = {branch: pass_at(path, followed(path, BranchPolicy(branch), q, s))[0] for branch in ("follow", "nearest")}
    assert found == {"follow": 20, "nearest": 65}
    assert pass_at(path, followed(path, BranchPolicy("follow", capture=0.08), q, s))[0] == 65


def test_it_does_not_jump_back_and_forth():
    """Between two branches a distance 1 apart: over at two thirds, back at one third, and never in between."""
    path = WaypointPath([[0, 0], [1, 0], [2, 0], [3, 0.5], [2, 1], [1, 1], [0, 1]], 1.0)
    upper = 0.5 * path.parameters[-1]
    low, high = float(path.sigma_bar([1.0, 0.0])), float(path.sigma_bar([1.0, 1.0]))
    assert low < upper < high
    policy = BranchPolicy("follow")
    sway = np.linspace(0, 1, 101)
    up, down = np.stack([np.ones(101), sway], -1), np.stack([np.ones(101), sway[::-1]], -1)
    distances = [np.linalg.norm(path.q_d(np.array(s)) - up, axis=-1) for s in (low, high)]
    there, back = followed(path, policy, up, low), followed(path, policy, down, high)
    assert np.allclose(sway[np.argmax(there > upper)], 2 / 3, atol=0.03)
    assert np.allclose(sway[::-1][np.argmax(back < upper)], 1 / 3, atol=0.03)
    assert np.count_nonzero(np.diff(there > upper)) == np.count_nonzero(np.diff(back > upper)) == 1
    # swaying about the place of the jump
    first = np.argmax(distances[1] < 0.5 * distances[0])
    dither = up[first] + np.random.default_rng(0).uniform(-0.1, 0.1, size=(100, 1)) * np.array([0.0, 1.0])
    found = followed(path, policy, np.concatenate([up[: first - 20], dither]), low)
    assert np.count_nonzero(np.diff(found > upper)) == 1


def test_laps_are_kept_by_a_jump():
    task = Lissajous([1.0, 1.0], [1, 2], 1.0)
    s = 5 * task.period + 0.8
    q = task.q_d(np.array([0.8 + np.pi]))  # on the other half of the figure
    for branch in ("follow", "nearest"):
        found = followed(task, BranchPolicy(branch), q, s)
        assert found == pytest.approx(5 * task.period + 0.8 + np.pi, abs=1e-6) or found == pytest.approx(
            5 * task.period + 0.8 - np.pi, abs=1e-6
        )
    # over the seam
    found = followed(task, BranchPolicy("nearest"), task.q_d(np.array([0.01])), s=3 * task.period - 0.01)
    assert found == pytest.approx(3 * task.period + 0.01)


@given(floats(0.3, 2.0), vectors(2, 3.0).filter(lambda q: np.linalg.norm(q) > 1e-3), floats(-20.0, 20.0))
def test_a_closed_form_is_the_same_under_each_policy(radius, q, last):
    task = Circle(radius, 1.0)
    angle = np.arctan2(q[1], q[0]) - last
    assume(abs(np.cos(angle / 2)) > 1e-6)  # half a lap ahead and behind are as near
    found = [followed(task, BranchPolicy(branch), q[None], last)[0] for branch in ("follow", "nearest", "local")]
    assert found == pytest.approx([found[0]] * 3, abs=1e-9)


# --- in the law ---------------------------------------------------------------------------------------------


def test_each_rollout_is_judged_alone(ideal_arm):
    path, rng = zigzag(150), np.random.default_rng(3)
    last = rng.uniform(*path.one_traverse, size=(6, 5))
    q = path.q_d(last) + rng.normal(size=(6, 5, 2)) * rng.choice([1e-3, 1e-2, 0.3], size=(6, 5, 1))
    for branch in ("follow", "nearest", "local"):
        policy = BranchPolicy(branch)
        s = policy.sigma_bar(path, q, last)
        many = policy.captured(path, q, s, path.q_d(s))
        each = [followed(path, policy, x[None], z)[0] for x, z in zip(q.reshape(-1, 2), last.reshape(-1), strict=True)]
        assert many.shape == last.shape
        assert np.array_equal(many.reshape(-1), each)


@pytest.mark.parametrize("path", [Circle(1.0, 2.0), Ellipse([1.0, 0.5], 1.0)])
def test_one_posture_far_from_the_path_may_be_of_several_rollouts(ideal_arm, path):
    """So it is where each rollout has an observer of its own."""
    law = Projection(ideal_arm, path, 800.0, 50.0, friction="observed", observer_hz=[[10.0], [20.0]])
    runs = [simulate(law, q, duration=0.1, progress=False) for q in ([0.7, 1.2], [[0.7, 1.2]] * 2)]
    assert runs[0].array("q") == pytest.approx(runs[1].array("q"), abs=1e-12)


def test_the_law_goes_on_from_the_branch_it_was_pushed_to(ideal_arm):
    path = zigzag(300)
    law = Projection(ideal_arm, path, 100.0, 20.0, start="nearest")
    q = path.q_d(np.array(middle_of_pass(path, 20)))
    z = law.start(q, 0 * q)
    pushed, passes = q + np.array([0.0, 0.5]), []
    for x in (q, pushed, pushed, pushed):
        out = law.law(0.0, x, 0 * x, z)
        z = law.advance(z, out, 0.0025)
        passes.append(int(pass_at(path, out.s)))
        assert out.regular
        assert np.linalg.norm(out.e_p) < SPACING
    assert passes == [20, 270, 270, 270]


def test_the_policy_is_recorded(ideal_arm):
    law = Projection(ideal_arm, Circle(1.0, 1.0), 100.0, 20.0, branch="local", capture=0.2)
    assert law.describe()["branch"] == "local"
    assert law.describe()["capture"] == 0.2
    default = Projection(ideal_arm, Circle(1.0, 1.0), 100.0, 20.0).describe()
    assert (default["branch"], default["capture"]) == ("follow", 0.1)


def test_a_bad_policy_is_refused(ideal_arm):
    with pytest.raises(UnknownNameError, match="branch = 'closest', expected one of 'follow', 'nearest', 'local'"):
        Projection(ideal_arm, Circle(1.0, 1.0), 100.0, 20.0, branch="closest")
    for capture in (0.0, -0.1, np.nan, [0.1, 0.2]):
        with pytest.raises(InputError, match="capture = "):
            Projection(ideal_arm, Circle(1.0, 1.0), 100.0, 20.0, capture=capture)


def test_the_capture_distance_of_a_file_is_an_angle():
    section = section_of(Projection, given=LAWS.given)(k_p=800.0, K_v=45.0, branch="follow", capture=9.0)
    assert section.arguments(np.deg2rad) == {
        "k_p": 800.0,
        "K_v": 45.0,
        "branch": "follow",
        "capture": pytest.approx(np.pi / 20),
    }
