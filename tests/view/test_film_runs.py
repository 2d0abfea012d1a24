"""Films of several runs: arms beside one another or as ghosts, meshes sent once, names with their colours."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from test_film import Reel, made_up_run, played, reel

from pathcontrol import Circle, RobotModel, Run, load_robot
from pathcontrol.view.animation.record import MOST_GHOSTS, record
from pathcontrol.view.animation.scene.arm_layout import shifts
from pathcontrol.view.animation.scene.camera import picture_axes

seeds = st.integers(0, 2**32 - 1)

MESHED = """
<robot name="meshed"><link name="base"><visual><geometry><mesh filename="ball.stl"/></geometry></visual></link>
  <joint name="turn" type="continuous"><origin xyz="0 0 0.4"/><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/></joint>
  <link name="arm"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual name="same"><geometry><mesh filename="ball.stl"/></geometry>
      <material name="red"><color rgba="1 0 0 1"/></material></visual>
    <visual name="larger"><origin xyz="0 0 0.3"/><geometry><mesh filename="ball.stl" scale="2 2 2"/></geometry>
    </visual></link>
  <joint name="tip_joint" type="fixed"><origin xyz="0 0 0.5"/><parent link="arm"/><child link="tip"/></joint>
  <link name="tip"/></robot>"""


def swinging(robot: RobotModel, center: float = 0.0, duration: float = 2.0, samples: int = 201) -> Run:
    t = np.linspace(0, 1, samples)[:, None]
    return made_up_run(robot, center + 0.8 * np.sin(6 * t + np.arange(robot.n)), duration)


def pair(arm: RobotModel) -> Mapping[str, Run]:
    return {"first": swinging(arm), "second": swinging(arm, 1.0, 3.0)}


def places(film: Reel) -> list[np.ndarray]:
    """Where the arms stand, (4, 4) each."""
    transforms = film.transforms()
    return [transforms[f"arms/{i}"] for i in range(len(film.header["runs"]))]


@pytest.fixture
def meshed(tmp_path: Path) -> RobotModel:
    trimesh.creation.icosphere(subdivisions=3, radius=0.1).export(tmp_path / "ball.stl")
    (tmp_path / "meshed.urdf").write_text(MESHED)
    return load_robot(tmp_path / "meshed.urdf")


# --- beside one another -------------------------------------------------------------------------------------


@given(seeds, st.integers(1, 5))
def test_what_stands_beside_another_is_apart_and_keeps_its_order_and_size(seed: int, arms: int) -> None:
    rng = np.random.default_rng(seed)
    extents = [rng.normal(size=3) + rng.uniform(0.1, 2, size=3) * rng.normal(size=(40, 3)) for _ in range(arms)]
    direction = rng.normal(size=3)
    direction[2] = abs(direction[2])
    direction /= np.linalg.norm(direction)
    right = picture_axes(direction)[0]
    moved = shifts(extents, direction, "beside")
    np.testing.assert_array_equal(moved[0], 0)
    np.testing.assert_allclose(np.cross(moved, right), 0, atol=1e-9)
    np.testing.assert_allclose(moved[:, 2], 0, atol=1e-12)
    spans = [(points + shift) @ right for points, shift in zip(extents, moved, strict=True)]
    for left, following in pairwise(spans):
        assert left.max() < following.min()
    np.testing.assert_array_equal(shifts(extents, direction, "ghosted"), 0)


def test_every_run_has_its_arm_line_markers_and_name(arm: RobotModel, circle: Circle) -> None:
    film = reel(record(pair(arm), task=circle))
    names = [run["name"] for run in film.header["runs"]]
    assert names == ["first", "second"]
    assert [label["text"] for label in film.header["labels"]] == names
    colors = [run["color"] for run in film.header["runs"]]
    assert colors[0] != colors[1]
    assert [label["color"] for label in film.header["labels"]] == colors
    for i in range(2):
        assert film.header["labels"][i]["path"] == f"/meshcat/arms/{i}"
        assert {f"lines/{i} desired path", f"lines/{i} path taken"} <= film.objects().keys()
        assert {f"arms/{i}/1 link_1", f"markers/{i} tool"} <= film.tracks().keys()
        assert f"markers/{i} desired" in film.transforms()
    assert film.header["duration"] == 3.0
    assert film.header["title"] == ["cicese_2dof", "first, second", "3 s"]


def test_one_run_has_no_label(arm: RobotModel) -> None:
    assert reel(record(swinging(arm))).header["labels"] == []
    alone = reel(record({"alone": swinging(arm)}))
    assert alone.header["labels"] == []
    assert alone.header["runs"][0]["name"] == "alone"


def test_each_arm_is_where_it_was_in_its_run_but_moved(arm: RobotModel) -> None:
    runs, film = pair(arm), reel(record(pair(arm)))
    for i, (run, place) in enumerate(zip(runs.values(), places(film), strict=True)):
        np.testing.assert_array_equal(place[:3, :3], np.eye(3))
        positions, rotations = played(film.tracks()[f"arms/{i}/2 link_2"], run.time.astype(np.float32))
        poses = arm.frame_pose(run.array("q")[0], "link_2")
        assert np.abs(positions - poses[:, :3, 3]).max() <= 5e-5
        assert np.abs(rotations - poses[:, :3, :3]).max() <= 5e-5
        tool = arm.frame_pose(run.array("q")[0], "tool")[:, :3, 3] + place[:3, 3]
        marker, _ = played(film.tracks()[f"markers/{i} tool"], run.time.astype(np.float32))
        np.testing.assert_allclose(marker, tool, atol=6e-5)
        line = film.center_line(f"lines/{i} path taken")
        np.testing.assert_allclose(line[[0, -1]], tool[[0, -1]], atol=1e-5)


def test_robots_and_tasks_may_differ(arm: RobotModel, meshed: RobotModel) -> None:
    film = reel(record({"two joints": swinging(arm), "one joint": swinging(meshed)}))
    assert film.header["title"][0] == "cicese_2dof, meshed"
    assert film.header["plane"]["unit"] == "mm"
    assert np.linalg.norm(places(film)[1][:3, 3]) > 0.5


def test_the_same_run_twice_shares_one_scale(arm: RobotModel, circle: Circle) -> None:
    s = np.linspace(0, 6, 301)
    runs = {f"{off:g}": made_up_run(arm, circle.q_d(s) + off, 3.0, s) for off in (0.01, 0.02)}
    film = reel(record(runs, task=circle))
    [scale] = [entry for entry in film.header["legend"] if entry["kind"] == "scale"]
    largest = np.rad2deg(np.abs(np.hypot(*(circle.q_d(s) + 0.02).T) - circle.radius).max())
    assert float(scale["to"]) == pytest.approx(largest, rel=5e-3)


# --- ghosts -------------------------------------------------------------------------------------------------


def test_ghosts_stand_in_the_first_arm_see_through_and_in_the_colours_of_their_runs(
    arm: RobotModel, circle: Circle
) -> None:
    film = reel(record(pair(arm), task=circle, layout="ghosted"))
    np.testing.assert_array_equal(places(film), [np.eye(4), np.eye(4)])
    tint = film.header["runs"][1]["color"]
    for path, thing in film.objects().items():
        material = thing["materials"][0]
        if path.startswith("arms/0"):
            assert material["opacity"] == 1
        elif path.startswith("arms/1"):
            assert material["opacity"] == pytest.approx(0.35)
            assert material["color"] == sum(round(255 * c) << shift for c, shift in zip(tint, (16, 8, 0), strict=True))
    assert "lines/1 desired path" not in film.objects()  # it is the same
    for i, run in enumerate(film.header["runs"]):
        np.testing.assert_allclose(
            film.attribute(f"lines/{i} path taken", "color"),
            [run["color"]] * len(film.attribute(f"lines/{i} path taken")),
            atol=1e-6,
        )
    assert [e["label"] for e in film.header["legend"] if e["kind"] == "line"] == ["desired path", "first", "second"]
    heights = [label["offset"][2] for label in film.header["labels"]]
    assert heights[1] > heights[0]


def test_a_crowd_of_ghosts_is_named_by_the_legend_only(arm: RobotModel, circle: Circle) -> None:
    runs = {f"run {i}": swinging(arm) for i in range(MOST_GHOSTS + 1)}
    crowd, few = (record(some, task=circle, layout="ghosted").film.header for some in (runs, dict([*runs.items()][1:])))
    assert crowd["labels"] == []
    assert [label["text"] for label in few["labels"]] == [*runs][1:]
    assert {entry["label"] for entry in crowd["legend"]} >= runs.keys()


def test_a_lone_run_is_no_ghost(arm: RobotModel, circle: Circle) -> None:
    ghost, lone = (reel(record({"run": swinging(arm)}, task=circle, layout=way)) for way in ("ghosted", "beside"))
    assert ghost.header["legend"] == lone.header["legend"]
    assert ghost.objects() == lone.objects()
    np.testing.assert_equal(ghost.transforms(), lone.transforms())


# --- meshes -------------------------------------------------------------------------------------------------


def test_a_mesh_is_sent_once_and_copied(meshed: RobotModel) -> None:
    film = reel(record({"a": swinging(meshed), "b": swinging(meshed, 1.0)}))
    sent = [path for path in film.objects() if path.startswith("arms")]
    assert sent == ["arms/0/0 base/0 ", "arms/0/1 arm/2 larger"]
    copies = {c["to"].removeprefix("/meshcat/"): c for c in film.commands("copy")}
    assert copies.keys() == {"arms/0/1 arm/1 same", "arms/1/0 base/0 ", "arms/1/1 arm/1 same", "arms/1/1 arm/2 larger"}
    assert copies["arms/0/1 arm/1 same"]["copy"] == "/meshcat/arms/0/0 base/0 "
    assert copies["arms/0/1 arm/1 same"]["color"] == [1, 0, 0, 1]
    assert "color" not in copies["arms/1/0 base/0 "]
    assert copies.keys() <= film.transforms().keys()


def test_copies_come_after_what_they_are_of(meshed: RobotModel) -> None:
    there: set[str] = set()
    for command in Reel(record({"a": swinging(meshed), "b": swinging(meshed)}).film).ordered():
        if command["type"] == "copy":
            assert command["copy"] in there
        elif command["type"] == "set_object":
            there.add(command["path"])


@settings(max_examples=10)
@given(st.lists(st.text(st.characters(exclude_categories=["Cs"])), min_size=1, max_size=4, unique=True))
def test_any_name_of_a_run_is_kept(names: list[str]) -> None:
    arm = load_robot("cicese_2dof")
    film = reel(record({name: made_up_run(arm, np.full((1, 2), 0.1 * i), 0.0) for i, name in enumerate(names)}))
    assert [run["name"] for run in film.header["runs"]] == names
    assert film.header["tables"][-1]["columns"][1:] == names


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_robots_with_heavy_meshes_make_light_pages(name: str) -> None:
    pytest.importorskip("example_robot_data")
    lock = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0} if name == "panda" else {}
    robot = load_robot(name, lock=lock)
    animation = record({"one": swinging(robot), "two": swinging(robot, 0.3)})
    assert len(animation.html()) < {"ur5": 3e6, "panda": 4e6}[name]
    film = reel(animation)
    digests = [
        hashlib.sha256(film.attribute(path).tobytes()).hexdigest()
        for path, thing in film.objects().items()
        if path.startswith("arms") and thing["geometries"][0]["type"] == "BufferGeometry"
    ]
    assert len(digests) == len(set(digests)) > 10
