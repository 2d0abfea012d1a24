"""A film shows what happened: placements are forward kinematics, lines are the tool's, names stay names."""

from __future__ import annotations

import re
import socket
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
import zmq
from scipy.spatial.transform import Rotation
from test_view_motion import to_polyline

from pathcontrol import Circle, InputError, PathTask, RobotModel, Run, UnknownNameError, load_robot
from pathcontrol.view.film.recorder import Animation, default_tool, record

HOSTILE = "</script><script>alert(1)</script>"
ESCAPED = HOSTILE.replace("<", "&lt;").replace(">", "&gt;")

# a branch, a fixed joint, every kind of shape, a prismatic joint, and names that mean something to JavaScript
ODD = f"""
<robot name="{ESCAPED}">
  <link name="__proto__"><visual name="{ESCAPED}"><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
  <joint name="turn" type="revolute"><origin xyz="0 0 0.1" rpy="0.3 0 0.2"/><parent link="__proto__"/>
    <child link="a/b"/><axis xyz="0 0.6 0.8"/><limit lower="-9" upper="9" effort="1" velocity="1"/></joint>
  <link name="a/b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><origin xyz="0 0 0.2" rpy="0.5 0.4 0.1"/>
      <geometry><cylinder radius="0.04" length="0.4"/></geometry></visual>
    <visual><geometry><sphere radius="0.06"/></geometry></visual></link>
  <joint name="slide" type="prismatic"><origin xyz="0 0 0.4"/><parent link="a/b"/><child link="{ESCAPED}"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="{ESCAPED}"><inertial><mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="fixed" type="fixed"><origin xyz="0.1 0 0"/><parent link="{ESCAPED}"/><child link="tip"/></joint>
  <link name="tip"><visual><geometry><sphere radius="0.02"/></geometry></visual></link>
</robot>"""


def made_up_run(robot: RobotModel, q: np.ndarray, duration: float, s: np.ndarray | None = None) -> Run:
    """A run through joint positions (time, n), or (rollout, time, n), at equal steps of time."""
    q = np.atleast_3d(q.T).T if q.ndim == 2 else q
    s = np.zeros(q.shape[:2]) if s is None else np.broadcast_to(s, q.shape[:2])
    time = np.linspace(0.0, duration, q.shape[1])
    joints = dict.fromkeys(robot.joint_names, "rad")
    return Run.from_arrays(time, joints, {"q": q, "s": s}, {"controller": {"controller": "None"}})


def commands(animation: Animation, kind: str) -> list[dict[str, Any]]:
    decoded = [umsgpack.unpackb(command) for command in animation.commands]
    return [command for command in decoded if command["type"] == kind]


def transforms(animation: Animation) -> dict[str, np.ndarray]:
    """Poses by path, (4, 4); the pose of an object is relative to what is above it."""
    found = commands(animation, "set_transform")
    return {c["path"].removeprefix("/meshcat/"): np.reshape(c["matrix"], (4, 4)).T for c in found}


def tracks(animation: Animation) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Times [s], positions and quaternions of what moves, by path."""
    found = {}
    for entry in commands(animation, "set_animation")[0]["animations"]:
        clip = entry["clip"]
        keys = {track["name"]: track["keys"] for track in clip["tracks"]}
        times = [np.array([key["time"] for key in keys[name]]) / clip["fps"] for name in keys]
        np.testing.assert_array_equal(*times)
        values = [np.array([key["value"] for key in keys[name]]) for name in (".position", ".quaternion")]
        found[entry["path"].removeprefix("/meshcat/")] = (times[0], *values)
    return found


def geometry(animation: Animation, path: str) -> dict[str, Any]:
    [found] = [c for c in commands(animation, "set_object") if c["path"] == f"/meshcat/{path}"]
    return found["object"]["geometries"][0]


def vertices(animation: Animation, path: str) -> np.ndarray:
    packed = geometry(animation, path)["data"]["attributes"]["position"]["array"]
    return np.frombuffer(packed.data, dtype=np.float32).reshape(-1, 3).astype(float)


def center_line(animation: Animation, path: str) -> np.ndarray:
    """Where the middle of a tube runs, (k, 3)."""
    return vertices(animation, path).reshape(-1, 6, 3).mean(axis=1)


@pytest.fixture(scope="module")
def odd() -> RobotModel:
    return load_robot(ODD)


def wild(robot: RobotModel, samples: int = 301, duration: float = 3.0) -> Run:
    """Three turns of every joint, one after the other."""
    t = np.linspace(0, 1, samples)[:, None]
    return made_up_run(robot, 6 * np.pi * t + np.sin(9 * t + np.arange(robot.n)), duration)


def circling(robot: RobotModel, task: PathTask, laps: float = 1.5) -> Run:
    """The path followed with a constant error."""
    s = np.linspace(0, 2 * np.pi * laps, 801)
    return made_up_run(robot, task.q_d(s) + 0.05, 4.0, s)


@pytest.fixture(scope="module")
def circle_film(arm: RobotModel, circle: Circle) -> Animation:
    return record(circling(arm, circle), arm, circle)


class Tags(HTMLParser):
    """Elements, attributes that load something, and the title of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.loads, self.title = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        self.loads += [value for name, value in attrs if name in ("src", "href", "action", "data")]

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] == "title":
            self.title += data.strip()


# --- placement ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cicese_2dof", "odd"])
def test_links_are_where_forward_kinematics_says(name: str, odd: RobotModel, arm: RobotModel) -> None:
    robot = odd if name == "odd" else arm
    run = wild(robot)
    moving = tracks(record(run, robot, fps=37.0))
    links = {path.removeprefix("arm/")[2:].replace("|", "/"): track for path, track in moving.items()}
    assert links.keys() == ({"a/b", HOSTILE, "tip"} if name == "odd" else {"link_1", "link_2"})
    for link, (times, positions, quaternions) in links.items():
        q = np.column_stack([np.interp(times, run.time, joint) for joint in run.array("q")[0].T])
        poses = robot.frame_pose(q, link)
        np.testing.assert_allclose(positions, poses[:, :3, 3], atol=1e-6)
        np.testing.assert_allclose(Rotation.from_quat(quaternions).as_matrix(), poses[:, :3, :3], atol=1e-6)


def test_quaternions_are_unit_and_do_not_flip(odd: RobotModel) -> None:
    for _, _, quaternions in tracks(record(wild(odd), odd)).values():
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1, atol=1e-6)
        assert ((quaternions[1:] * quaternions[:-1]).sum(-1) > 0).all()


def test_what_stands_still_is_placed_once(arm: RobotModel, circle_film: Animation) -> None:
    assert not any("base" in path for path in tracks(circle_film))
    np.testing.assert_array_equal(transforms(circle_film)["arm/0 base"], arm.frame_pose(np.zeros(2), "base"))


def test_a_cylinder_lies_along_z_of_its_origin(odd: RobotModel) -> None:
    film = record(wild(odd), odd)
    [path] = [p for p in transforms(film) if p.startswith("arm/1 a|b/1 ")]
    assert geometry(film, path)["type"] == "CylinderGeometry"
    rotation = Rotation.from_euler("xyz", [0.5, 0.4, 0.1]).as_matrix()
    np.testing.assert_allclose(transforms(film)[path][:3, 1], rotation[:, 2], atol=1e-6)
    np.testing.assert_allclose(transforms(film)[path][:3, 3], [0, 0, 0.2], atol=1e-6)


def test_the_film_lasts_as_long_as_the_run_and_repeats(circle_film: Animation) -> None:
    assert {times[-1] for times, _, _ in tracks(circle_film).values()} == {4.0}
    [command] = commands(circle_film, "set_animation")
    assert command["options"] == {"play": True, "repetitions": float("inf")}


def test_a_locked_joint_stays_where_it_was_locked(arm: RobotModel) -> None:
    robot = arm.reduced({"joint_1": 0.7})
    film = record(wild(robot), robot)
    np.testing.assert_allclose(
        transforms(film)["arm/1 link_1"], arm.frame_pose(np.array([0.7, 0.0]), "link_1"), atol=1e-6
    )


def test_an_arm_at_rest_needs_no_animation(arm: RobotModel) -> None:
    film = record(made_up_run(arm, np.full((1, 2), 0.3), 0.0), arm)
    assert commands(film, "set_animation") == []
    assert commands(record(made_up_run(arm, np.full((9, 2), 0.3), 1.0), arm), "set_animation") == []


def test_a_robot_without_visuals_is_shown_as_sticks(arm: RobotModel) -> None:
    bare = load_robot(re.sub(r"<visual.*?</visual>", "", arm.source.text, flags=re.DOTALL))
    film = record(wild(bare), bare)
    assert {"arm/0 base/0 stick", "arm/1 link_1/2 stick"} <= transforms(film).keys()


# --- lines --------------------------------------------------------------------------------------------------


def test_the_desired_line_is_the_tool_on_the_path(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    line = center_line(circle_film, "lines/desired path")
    dense = arm.frame_pose(circle.q_d(np.linspace(0, 2 * np.pi, 3001)), "tool")[:, :3, 3]
    assert to_polyline(line, dense).max() < 1e-6  # nothing is drawn beside the path
    assert to_polyline(dense, line).max() < 1e-3  # and no part of it is left out
    np.testing.assert_allclose(line[0], line[-1], atol=1e-6)


def test_the_line_taken_is_the_tool_in_the_run(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    line = center_line(circle_film, "lines/path taken")
    samples = arm.frame_pose(circling(arm, circle).array("q")[0], "tool")[:, :3, 3]
    assert np.linalg.norm(line[:, None] - samples, axis=-1).min(axis=1).max() < 1e-6
    np.testing.assert_allclose(line[[0, -1]], samples[[0, -1]], atol=1e-6)


def test_the_desired_point_is_the_tool_at_q_d_of_s(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    times, positions, _ = tracks(circle_film)["desired point"]
    s = times / 4.0 * 3 * np.pi
    np.testing.assert_allclose(positions, arm.frame_pose(circle.q_d(s), "tool")[:, :3, 3], atol=1e-6)


def test_a_path_without_end_is_drawn_as_far_as_the_run_went(arm: RobotModel) -> None:
    class Ray(PathTask):
        def q_d(self, s: np.ndarray) -> np.ndarray:
            return np.stack([0.1 * s, 0 * s], axis=-1)

        def theta(self, s: np.ndarray) -> np.ndarray:
            return np.ones_like(s)

    s = np.linspace(0, 5, 101)
    line = center_line(record(made_up_run(arm, Ray().q_d(s), 2.0, s), arm, Ray()), "lines/desired path")
    ends = arm.frame_pose(Ray().q_d(s[[0, -1]]), "tool")[:, :3, 3]
    np.testing.assert_allclose(line[[0, -1]], ends, atol=1e-6)


def test_without_a_task_only_the_line_taken_is_drawn(arm: RobotModel) -> None:
    film = record(wild(arm), arm)
    assert list(film.legend) == ["path taken"]
    assert not any("desired" in c["path"] for c in commands(film, "set_object"))


def test_another_frame_can_be_the_tool(arm: RobotModel) -> None:
    run = wild(arm)
    line = center_line(record(run, arm, tool="link_2"), "lines/path taken")
    np.testing.assert_allclose(line[0], arm.frame_pose(run.array("q")[0, 0], "link_2")[:3, 3], atol=1e-6)


def test_the_tool_is_the_last_link_that_carries_no_other(arm: RobotModel, odd: RobotModel) -> None:
    assert default_tool(arm) == "tool"
    assert default_tool(odd) == "tip"


def test_each_rollout_has_its_own_film(arm: RobotModel) -> None:
    q = np.stack([wild(arm).array("q")[0], -wild(arm).array("q")[0]])
    second = record(made_up_run(arm, q, 3.0), arm, rollout=1)
    alone = record(made_up_run(arm, q[1], 3.0), arm)
    np.testing.assert_array_equal(vertices(second, "lines/path taken"), vertices(alone, "lines/path taken"))
    assert second.title[-1] == "rollout 1"


# --- arguments ----------------------------------------------------------------------------------------------


def test_what_does_not_belong_together_is_refused(arm: RobotModel, odd: RobotModel) -> None:
    with pytest.raises(InputError, match="joints"):
        record(wild(arm), odd)
    with pytest.raises(InputError, match="3 joints"):
        record(wild(arm), arm, Circle(1.0, 1.0, center=[0, 0, 0]))
    with pytest.raises(InputError, match="rollout 3"):
        record(wild(arm), arm, rollout=3)
    with pytest.raises(InputError, match="fps"):
        record(wild(arm), arm, fps=0)
    with pytest.raises(UnknownNameError, match="nozzle"):
        record(wild(arm), arm, tool="nozzle")
    with pytest.raises(InputError, match="finite"):
        record(made_up_run(arm, np.full((5, 2), np.nan), 1.0), arm)


# --- the page -----------------------------------------------------------------------------------------------


def test_hostile_names_stay_text(odd: RobotModel) -> None:
    text = record(wild(odd), odd).html()
    page = Tags(text)
    assert odd.name == HOSTILE
    assert page.tags.count("script") == 3
    assert page.title.startswith(HOSTILE)
    assert "alert(1)</script>" not in text


def test_nothing_is_loaded_from_anywhere(circle_film: Animation) -> None:
    text = circle_film.html()
    assert Tags(text).loads == []
    assert set(re.findall(r"\w+://[\w.]*", text)) <= {"http://www.w3.org", "ws://"}  # an XML namespace; a default
    assert "default-src 'none'" in text


def test_the_title_says_what_it_is(circle_film: Animation) -> None:
    assert circle_film.title == ("cicese_2dof", "None", "4 s")


def test_recording_starts_no_process_and_opens_no_socket(
    arm: RobotModel, circle: Circle, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*args: object, **kwargs: object) -> None:
        raise AssertionError("recording must stay within this process")

    entries = [(socket.socket, "bind"), (socket.socket, "connect")]
    for owner, name in [*entries, (subprocess.Popen, "__init__"), (zmq.Context, "socket")]:
        monkeypatch.setattr(owner, name, refuse)
    record(circling(arm, circle), arm, circle).html()


def test_a_saved_page_is_what_html_says(circle_film: Animation, tmp_path: Path) -> None:
    path = circle_film.save(tmp_path / "new folder" / "film.html")
    assert path == tmp_path / "new folder" / "film.html"
    assert path.read_text(encoding="utf-8") == circle_film.html()


def test_a_page_is_saved_whole_or_not_at_all(
    circle_film: Animation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(self: Path, data: str, **kwargs: object) -> None:
        self.write_bytes(data[: len(data) // 2].encode())
        raise OSError("the disk is full")

    (tmp_path / "old.html").write_bytes(b"old")
    monkeypatch.setattr(Path, "write_text", half)
    for name in ("old.html", "new.html"):
        with pytest.raises(OSError, match="full"):
            circle_film.save(tmp_path / name)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"old.html": b"old"}
