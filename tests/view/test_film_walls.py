"""A film shows the walls of its run: where they stand, of each rollout its own, and only while they do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import opened
from test_film import Reel, made_up_run, reel

import pathcontrol as pc
from pathcontrol.view.report.comparison_page import save_comparison

LOOP = pc.SampledLoop(torque_limits=True)
POINT, NORMAL = np.array([0.7, 0.1, 0.3]), np.array([-2.0, 0.3, 0.6])


@pytest.fixture(scope="module")
def law() -> pc.Controller:
    robot = pc.load_robot("cicese_2dof")
    return pc.ExtendedMotionPlan(robot, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)


def run(law: pc.Controller, disturbance: pc.Disturbance | None, rollouts: int = 1, first: int = 0) -> pc.Run:
    q = np.tile(law.task.q_d(np.array(0.0)), (rollouts, 1))
    own = {"disturbance": disturbance, "first_rollout": first}
    return pc.simulate(law, q, duration=0.3, loop=LOOP, progress=False, **own)


def front(film: Reel, name: str = "walls/0 0") -> tuple[np.ndarray, np.ndarray]:
    """The middle and the outward normal of the front of a plate, from its box and the pose of the box."""
    poses, shape = film.transforms(), film.objects()[f"{name}/plate"]["geometries"][0]
    pose = poses[name] @ poses[f"{name}/plate"]
    return (pose @ [0.5 * shape["width"], 0.0, 0.0, 1.0])[:3], pose[:3, 0]


def check_plate(film: Reel, point: np.ndarray, normal: np.ndarray, name: str = "walls/0 0") -> None:
    """The front of the plate lies in the plane of the wall and looks out of it; WebGL has single precision."""
    middle, outward = front(film, name)
    unit = normal / np.linalg.norm(normal)
    np.testing.assert_allclose(outward, unit, atol=1e-6)
    assert abs((middle - point) @ unit) < 1e-6


@pytest.mark.parametrize("normal", [NORMAL, [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [-0.1, -5.0, 0.0]])
def test_a_plate_stands_where_the_wall_does(law: pc.Controller, normal: list[float]) -> None:
    wall = pc.Wall("tool", POINT, normal, stiffness=1e3, start=0.1, duration=0.1)
    film = reel(pc.record(run(law, pc.Push([0.0, 0.1]) + wall)))
    check_plate(film, POINT, np.array(normal))
    [timed] = film.header["timed"]
    assert timed == {"path": "/meshcat/walls/0 0", "from": pytest.approx(0.1), "to": pytest.approx(0.2)}
    assert [entry["label"] for entry in film.header["legend"]].count("wall") == 1


def test_a_plate_is_as_large_as_the_arm_and_opposite_to_it(law: pc.Controller) -> None:
    film = reel(pc.record(run(law, pc.Wall("tool", POINT, NORMAL, rigid=True))))
    shape = film.objects()["walls/0 0/plate"]["geometries"][0]
    assert shape["height"] == shape["depth"]
    assert 0.8 < shape["height"] < 2.0  # the tool of this arm is up to 0.9 m from its shoulder, that 1.1 m high
    assert film.header["timed"][0]["to"] is None
    assert film.objects()["walls/0 0/plate"]["materials"][0]["opacity"] < 1


def test_each_rollout_has_its_own_wall_even_alone_and_from_a_file(law: pc.Controller, tmp_path: Path) -> None:
    points = POINT + np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.1, 0.0, 0.0]])
    walls = pc.Wall("tool", points, NORMAL, rigid=True, start=[0.0, 0.1, 0.2])
    run(law, walls, 3, first=5).save(tmp_path / "run.nc")  # as the piece of a sweep
    whole = pc.Run.load(tmp_path / "run.nc")
    for rollout, one in ((0, whole.rollout(0)), (1, whole), (2, whole.rollout(2)), (2, whole)):
        film = reel(pc.record(one, rollout=rollout if one is whole else 0))
        check_plate(film, points[rollout], NORMAL)
        assert film.header["timed"][0]["from"] == pytest.approx(0.1 * rollout)


def test_arms_beside_each_other_have_a_wall_each_and_ghosts_share_it(law: pc.Controller) -> None:
    two = {name: run(law, pc.Wall("tool", POINT, NORMAL, rigid=True)) for name in "ab"}
    film = reel(pc.record(two))
    shift = film.transforms()["arms/1"][:3, 3]
    assert np.linalg.norm(shift) > 0.5
    check_plate(film, POINT, NORMAL)
    check_plate(film, POINT + shift, NORMAL, "walls/1 0")
    assert len(reel(pc.record(two, layout="ghosted")).header["timed"]) == 1


@pytest.mark.filterwarnings("ignore:the wall is")
@pytest.mark.parametrize(
    "wall",
    [
        None,
        pc.Wall("tool", [50.0, 0.0, 0.0], [-1.0, 0.0, 0.0], rigid=True),  # nowhere near
        pc.Wall("tool", POINT, NORMAL, rigid=True, start=7.0),  # after the end
    ],
)
def test_there_is_no_plate_where_no_wall_is(law: pc.Controller, wall: pc.Wall | None) -> None:
    film = reel(pc.record(run(law, wall)))
    assert film.header["timed"] == []
    assert "wall" not in [entry["label"] for entry in film.header["legend"]]


@pytest.mark.parametrize(
    "described", [{"disturbance": "Wall"}, {"disturbance": "Wall", "frame": "tool", "point": "?"}, 7]
)
def test_what_describes_no_wall_is_passed_over(described: object) -> None:
    robot = pc.load_robot("cicese_2dof")
    plain = made_up_run(robot, np.zeros((3, 2)), 1.0)
    config = plain.config | {"disturbance": {"disturbance": "sum", "terms": [described]}}
    damaged = pc.Run(plain.data, config).with_robot(robot)
    assert reel(pc.record(damaged, robot)).header["timed"] == []


def test_the_page_of_a_comparison_shows_the_wall(tmp_path: Path) -> None:
    compared = pc.compare(["projection"], "wall", rollouts=1, progress=False)
    wall = compared.scenario.disturbance
    assert isinstance(wall, pc.Wall)
    check_plate(reel(pc.record(compared.runs["projection"])), wall.point, wall.normal)
    assert "Timed" in save_comparison(compared, tmp_path / "wall.html").read_text(encoding="utf-8")


def test_the_browser_shows_the_wall_while_it_stands(tmp_path: Path) -> None:
    robot, wall = pc.load_robot("cicese_2dof"), pc.Wall("tool", POINT, NORMAL, rigid=True, start=1.0, duration=1.0)
    still = made_up_run(robot, np.zeros((31, 2)), 3.0)
    run = pc.Run(still.data, still.config | {"disturbance": wall.describe()})
    with opened(pc.record(run, robot).save(tmp_path / "film.html"), hash="#t=0") as film:
        pictures = []
        for moment in (0.99, 1.0, 1.99, 2.0):
            film("t => film.seek(t)", moment)
            pictures.append(film.picture())
        assert film.complaints == []
    np.testing.assert_array_equal(pictures[0], pictures[3])
    np.testing.assert_array_equal(pictures[1], pictures[2])
    changed = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8
    assert 0.03 < changed.mean() < 0.9
