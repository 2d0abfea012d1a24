"""A film shows what happened: placements are forward kinematics, lines are the tool's, names stay names."""

from __future__ import annotations

import re
import socket
import subprocess
import webbrowser
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import zmq
from scipy.spatial.transform import Rotation
from test_film import made_up_run, played, reel
from test_view_motion import to_polyline

from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathSequence,
    PathTask,
    RobotModel,
    Run,
    UnknownNameError,
    load_robot,
    simulate,
)
from pathcontrol.view.animation.animation import Animation
from pathcontrol.view.animation.record import record
from pathcontrol.view.animation.scene.camera import picture_axes
from pathcontrol.view.default_tool import default_tool

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
        self.tags, self.loads, self.title, self.attributes, self.policy = [], [], "", {}, ""
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        self.attributes |= attrs
        if dict(attrs).get("http-equiv") == "Content-Security-Policy":
            self.policy = dict(attrs)["content"]
        self.loads += [value for name, value in attrs if name in ("src", "href", "action", "data")]

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] == "title":
            self.title += data.strip()


# --- placement ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cicese_2dof", "odd"])
def test_links_are_where_forward_kinematics_says(name: str, odd: RobotModel, arm: RobotModel) -> None:
    robot = odd if name == "odd" else arm
    run = wild(robot)
    moving = {p.removeprefix("arms/0/")[2:].replace("|", "/"): t for p, t in reel(record(run)).tracks().items()}
    links = {link: track for link, track in moving.items() if link in robot.frame_names}
    assert links.keys() == ({"a/b", HOSTILE, "tip"} if name == "odd" else {"link_1", "link_2"})
    for link, track in links.items():
        positions, rotations = played(track, run.time.astype(np.float32))
        poses = robot.frame_pose(run.array("q")[0], link)
        assert np.linalg.norm(positions - poses[:, :3, 3], axis=-1).max() <= 5e-5
        assert np.abs(rotations - poses[:, :3, :3]).max() <= 5e-5


def test_quaternions_are_unit_and_do_not_flip(odd: RobotModel) -> None:
    for _, _, quaternions in reel(record(wild(odd))).tracks().values():
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1, atol=1e-6)
        assert ((quaternions[1:] * quaternions[:-1]).sum(-1) >= 0).all()


def test_what_stands_still_is_placed_once(arm: RobotModel, circle_film: Animation) -> None:
    film = reel(circle_film)
    assert not any("base" in path for path in film.tracks())
    np.testing.assert_array_equal(film.transforms()["arms/0/0 base"], arm.frame_pose(np.zeros(2), "base"))


def test_a_cylinder_lies_along_z_of_its_origin(odd: RobotModel) -> None:
    film = reel(record(wild(odd)))
    [path] = [p for p in film.transforms() if p.startswith("arms/0/1 a|b/1 ")]
    assert film.objects()[path]["geometries"][0]["type"] == "CylinderGeometry"
    rotation = Rotation.from_euler("xyz", [0.5, 0.4, 0.1]).as_matrix()
    np.testing.assert_allclose(film.transforms()[path][:3, 1], rotation[:, 2], atol=1e-6)
    np.testing.assert_allclose(film.transforms()[path][:3, 3], [0, 0, 0.2], atol=1e-6)


def test_the_film_lasts_as_long_as_the_run(circle_film: Animation) -> None:
    assert circle_film.duration == 4.0
    assert {times[-1] for times, _, _ in reel(circle_film).tracks().values()} == {4.0}


def test_a_run_that_begins_late_is_filmed_from_its_beginning(arm: RobotModel) -> None:
    q = wild(arm).array("q")[0]
    film = record(made_up_run(arm, q, 0.0, time=np.linspace(100.0, 103.0, len(q))))
    assert film.duration == 3.0
    assert {times[0] for times, _, _ in reel(film).tracks().values()} == {0.0}


def test_a_locked_joint_stays_where_it_was_locked(arm: RobotModel) -> None:
    robot = arm.reduced({"joint_1": 0.7})
    film = reel(record(wild(robot)))
    assert not any("link_1" in path for path in film.tracks())
    pose = arm.frame_pose(np.array([0.7, 0.0]), "link_1")
    np.testing.assert_allclose(film.transforms()["arms/0/1 link_1"], pose, atol=1e-6)


@pytest.mark.parametrize(("samples", "duration"), [(1, 0.0), (9, 1.0)])
def test_an_arm_at_rest_needs_no_tracks_and_draws_no_line(arm: RobotModel, samples: int, duration: float) -> None:
    film = reel(record(made_up_run(arm, np.full((samples, 2), 0.3), duration), task=Circle(1.0, 1.0)))
    assert film.tracks() == {}
    assert film.growing() == {}
    assert film.header["duration"] == duration
    assert "lines/0 desired path" in film.objects()


def test_a_robot_without_visuals_is_shown_as_sticks(arm: RobotModel) -> None:
    bare = load_robot(re.sub(r"<visual.*?</visual>", "", arm.source.text, flags=re.DOTALL))
    film = reel(record(wild(bare)))
    assert {"arms/0/0 base/0 stick", "arms/0/1 link_1/2 stick"} <= film.transforms().keys()


def test_the_same_run_gives_the_same_page(arm: RobotModel, circle: Circle) -> None:
    assert record(circling(arm, circle), arm, circle).html() == record(circling(arm, circle), arm, circle).html()


def test_all_that_is_seen_is_inside_the_picture(circle_film: Animation) -> None:
    film = reel(circle_film)
    camera = {name: np.array(value) for name, value in film.header["camera"].items()}
    seen = np.concatenate([film.attribute("lines/0 path taken"), film.attribute("lines/0 desired path")])
    slope = np.tan(np.deg2rad(35 / 2))
    distance = (camera["outline"][:, 2] + 1.08 * np.abs(camera["outline"][:, :2]).max(axis=1) / slope).max()
    right, up, near = picture_axes(camera["direction"]) @ (seen - camera["target"]).T
    assert (np.maximum(np.abs(right), np.abs(up)) < slope * (distance - near)).all()


# --- lines and markers --------------------------------------------------------------------------------------


def test_the_desired_line_is_the_tool_on_the_path(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    line = reel(circle_film).center_line("lines/0 desired path")
    dense = arm.frame_pose(circle.q_d(np.linspace(0, 2 * np.pi, 3001)), "tool")[:, :3, 3]
    assert to_polyline(line, dense).max() < 1e-6  # nothing is drawn beside the path
    assert to_polyline(dense, line).max() < 1e-3  # and no part of it is left out
    np.testing.assert_allclose(line[0], line[-1], atol=1e-6)


def test_the_line_taken_is_the_tool_in_the_run(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    line = reel(circle_film).center_line("lines/0 path taken")
    samples = arm.frame_pose(circling(arm, circle).array("q")[0], "tool")[:, :3, 3]
    assert np.linalg.norm(line[:, None] - samples, axis=-1).min(axis=1).max() < 1e-6
    np.testing.assert_allclose(line[[0, -1]], samples[[0, -1]], atol=1e-6)


def test_the_line_taken_ends_at_the_tool_at_every_time(arm: RobotModel, circle: Circle, circle_film: Animation) -> None:
    film, run = reel(circle_film), circling(arm, circle)
    times, indices = film.growing()["lines/0 path taken"]
    line, faces = film.center_line("lines/0 path taken"), film.faces("lines/0 path taken")
    assert len(times) == len(line)
    assert indices * (len(times) - 1) == faces.size
    q = np.stack([np.interp(times, run.time, joint) for joint in run.array("q")[0].T], axis=-1)
    np.testing.assert_allclose(line, arm.frame_pose(q, "tool")[:, :3, 3], atol=1e-4)
    for rings in (2, len(times) // 2, len(times)):  # what is drawn by then reaches up to there and no farther
        assert np.unique(faces.reshape(-1)[: indices * (rings - 1)] // 6).tolist() == list(range(rings))
    assert np.diff(times).max() <= 1 / 30


def test_the_markers_are_the_tool_at_q_d_of_s_and_the_arms_own(
    arm: RobotModel, circle: Circle, circle_film: Animation
) -> None:
    film, run = reel(circle_film), circling(arm, circle)
    wanted = {"desired": circle.q_d(run.array("s")[0]), "tool": run.array("q")[0]}
    for name, q in wanted.items():
        positions, _ = played(film.tracks()[f"markers/0 {name}"], run.time.astype(np.float32))
        assert np.linalg.norm(positions - arm.frame_pose(q, "tool")[:, :3, 3], axis=-1).max() <= 5e-5
    assert film.header["on_top"] == ["/meshcat/markers/0 desired", "/meshcat/markers/0 tool"]
    shown = [film.objects()[f"markers/0 {name}/ball"] for name in wanted]
    assert shown[0]["geometries"][0]["radius"] > 1.5 * shown[1]["geometries"][0]["radius"]
    assert shown[0]["materials"][0]["color"] != shown[1]["materials"][0]["color"]
    assert shown[0]["materials"][0]["opacity"] < 1


def test_a_path_without_end_is_drawn_as_far_as_the_run_went(arm: RobotModel) -> None:
    class Ray(PathTask):
        def q_d(self, s: np.ndarray) -> np.ndarray:
            return np.stack([0.1 * s, 0 * s], axis=-1)

        def theta(self, s: np.ndarray) -> np.ndarray:
            return np.ones_like(s)

    s = np.linspace(0, 5, 101)
    film = reel(record(made_up_run(arm, Ray().q_d(s), 2.0, s), arm, Ray()))
    ends = arm.frame_pose(Ray().q_d(s[[0, -1]]), "tool")[:, :3, 3]
    np.testing.assert_allclose(film.center_line("lines/0 desired path")[[0, -1]], ends, atol=1e-6)
    assert "path taken" in [entry["label"] for entry in film.header["legend"]]  # no nearest point, so no contour error


def test_corners_of_a_path_are_drawn_as_corners(arm: RobotModel) -> None:
    legs = [Line([0.0, 0.0], [0.3, 0.1], 1.0), Line([0.3, 0.1], [0.1, 0.4], 1.0), Line([0.1, 0.4], [0.0, 0.0], 1.0)]
    task = PathSequence(legs)
    line = reel(record(made_up_run(arm, np.zeros((1, 2)), 0.0), task=task)).center_line("lines/0 desired path")
    corners = arm.frame_pose(task.q_d(task.starts), "tool")[:, :3, 3]
    assert np.linalg.norm(line - corners[:, None], axis=-1).min(axis=1).max() < 1e-6


def test_without_a_task_only_the_line_taken_is_drawn(arm: RobotModel) -> None:
    film = reel(record(wild(arm), arm))
    assert [entry["label"] for entry in film.header["legend"]] == ["tool", "path taken"]
    assert not any("desired" in path for path in film.objects())
    assert film.header["plane"]["desired"] == film.header["plane"]["points"] == []


def test_a_run_brings_its_own_robot_and_task(ideal_arm: RobotModel, circle: Circle) -> None:
    controller = ExtendedMotionPlan(ideal_arm, circle, 100.0, 20.0, 1.0)
    run = simulate(controller, np.zeros(2), duration=0.1, progress=False)
    assert record(run).html() == record(run, ideal_arm, circle).html()
    other = Circle(0.5, 1.0)
    assert reel(record(run, task=other)).chart("rate")[1]["ϑ(s)"][0] == other.theta(np.array(0.0))


def test_another_frame_can_be_the_tool(arm: RobotModel) -> None:
    run = wild(arm)
    line = reel(record(run, arm, tool="link_2")).center_line("lines/0 path taken")
    np.testing.assert_allclose(line[0], arm.frame_pose(run.array("q")[0, 0], "link_2")[:3, 3], atol=1e-6)


def test_the_tool_is_the_end_of_the_arm(arm: RobotModel, odd: RobotModel) -> None:
    assert default_tool(arm) == "tool"
    assert default_tool(odd) == "tip"


def test_each_rollout_has_its_own_film(arm: RobotModel) -> None:
    q = np.stack([wild(arm).array("q")[0], -wild(arm).array("q")[0]])
    second = record(made_up_run(arm, q, 3.0), arm, rollout=1)
    alone = record(made_up_run(arm, q[1], 3.0), arm)
    lines = [reel(film).attribute("lines/0 path taken") for film in (second, alone)]
    np.testing.assert_array_equal(*lines)
    assert second.title[-1] == "rollout 1"


# --- arguments ----------------------------------------------------------------------------------------------


def test_what_does_not_belong_together_is_refused(arm: RobotModel, odd: RobotModel) -> None:
    with pytest.raises(InputError, match="joints"):
        record(wild(arm), odd)
    with pytest.raises(InputError, match="3 joints"):
        record(wild(arm), arm, Circle(1.0, 1.0, center=[0, 0, 0]))
    with pytest.raises(InputError, match="rollout 3"):
        record(wild(arm), arm, rollout=3)
    with pytest.raises(UnknownNameError, match=r"'behind'.*'beside'"):
        record(wild(arm), arm, layout="behind")
    for nothing in ({}, [wild(arm)], {"name": 1}):
        with pytest.raises(InputError, match="expected a Run"):
            record(nothing)
    with pytest.raises(InputError, match="robot="):
        record(Run(wild(arm).data, {}))
    with pytest.raises(UnknownNameError, match="nozzle"):
        record(wild(arm), arm, tool="nozzle")
    with pytest.raises(InputError, match="finite"):
        record(made_up_run(arm, np.full((5, 2), np.nan), 1.0), arm)


# --- the page -----------------------------------------------------------------------------------------------


def test_hostile_names_stay_text(odd: RobotModel, arm: RobotModel) -> None:
    text = record({HOSTILE: wild(odd), "harmless": wild(odd)}, odd).html()
    page, harmless = Tags(text), Tags(record({"one": wild(arm), "two": wild(arm)}, arm).html())
    assert odd.name == HOSTILE
    assert page.tags == harmless.tags
    assert page.title.startswith(HOSTILE)
    assert "alert(1)</script>" not in text


def test_nothing_is_loaded_from_anywhere(circle_film: Animation) -> None:
    text = circle_film.html()
    assert [address for address in Tags(text).loads if not address.startswith("#")] == []
    assert "default-src 'none'" in Tags(text).policy


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


def test_a_page_opens_in_the_browser_from_a_file(circle_film: Animation, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    path = circle_film.open()
    assert opened == [path.as_uri()]
    assert path.read_text(encoding="utf-8") == circle_film.html()
    path.unlink()
    path.parent.rmdir()


def test_a_notebook_shows_the_page_in_a_frame(circle_film: Animation) -> None:
    frame = Tags(circle_film._repr_html_())
    assert frame.tags == ["iframe"]
    assert frame.attributes["srcdoc"] == circle_film.html()
