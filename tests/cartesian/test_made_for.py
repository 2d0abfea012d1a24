"""What frame a path was made for travels with it, into what is made of it, files, films, figures and metrics."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.deviation import tool_positions
from pathcontrol.simulation.storage.array_store import ArrayStore
from pathcontrol.simulation.storage.task_recipes import task_of, task_recipe
from pathcontrol.tasks.laps import Laps
from pathcontrol.view.animation.recorded_runs import make_recordings
from pathcontrol.view.default_tool import default_tool, with_tool

TIP = np.array([0.0, 0.02, -0.1])
CURVE = pc.ToolCurve.circle([0.4, -0.05, 0.9], 0.08, [0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def arm() -> pc.RobotModel:
    """The bundled arm with a pen, and a link that carries no other beside it."""
    return pc.load_robot("cicese_2dof").with_friction(None).with_frame("pen", "link_2", [0.0, 0.0, -0.3])


@pytest.fixture(scope="module", params=["frame", "tool in the frame"])
def path(arm, request) -> pc.CartesianPath:
    if request.param == "frame":
        return pc.CartesianPath(arm, "pen", CURVE, speed=0.1)
    curve = pc.ToolCurve.circle([0.4, -0.03, 0.9], 0.08, [0.0, 1.0, 0.0])
    return pc.CartesianPath(arm, "pen", curve, speed=0.1, tool=TIP)


def made_of(path: pc.PathTask) -> dict[str, pc.PathTask]:
    half = path.s0 + 0.5 * path.period
    first, second = path.between(path.s0, half), path.between(half, path.s0 + path.period)
    return {
        "itself": path,
        "another profile": path.with_profile(pc.ConstantRate(0.05)),
        "reversed": path.reversed(),
        "shifted": path.shifted([0.1, 0.0]),
        "scaled": path.scaled(0.5),
        "a part": first,
        "by arc length": path.by_arc_length(),
        "laps": Laps(path, 2),
        "concatenated": pc.concatenated([first, second]),
        "a sequence": pc.PathSequence([first, second]),
        "a batch": pc.TaskBatch([path, path.reversed()]),
        "one of a batch": pc.TaskBatch([path, path.scaled(0.9)]).rows(np.array([1])),
        "all at once": path.scaled(0.9).reversed().between(path.s0, half).by_arc_length(),
    }


def test_what_is_made_of_a_path_is_made_for_its_frame(arm, path):
    for name, made in made_of(path).items():
        assert made.frame == "pen", name
        assert np.array_equal(made.tool_pose, path.tool_pose), name
        assert default_tool(arm, made) == "pen", name


def test_files_keep_it(path):
    for name, made in made_of(path).items():
        store = ArrayStore()
        again = task_of(task_recipe(made, store), ArrayStore(store.numbers))
        assert again.frame == "pen", name
        assert (again.tool_pose is None) == (path.tool_pose is None), name
        assert path.tool_pose is None or np.array_equal(again.tool_pose, path.tool_pose), name


def test_paths_for_different_frames_are_for_none_together(arm, path):
    other = pc.CartesianPath(arm, "tool", CURVE, speed=0.1)
    assert pc.TaskBatch([path, other]).frame is None
    assert pc.TaskBatch([path, other]).rows(np.array([1])).frame == "tool"
    assert pc.Circle(1.0, 1.0).frame is None


def test_film_figure_and_metrics_of_a_run_show_what_follows_the_curve(arm, path, tmp_path):
    law = pc.ExtendedMotionPlan(arm, path, 900.0, [60.0, 100.0], 20.0)
    velocity = path.at(np.array(path.s0)).velocity
    run = pc.simulate(law, path.start_posture, velocity, duration=0.5, progress=False)
    curve, loaded = path.curve, pc.Run.load(run.save(tmp_path / "run.nc"))
    for one in (run, loaded):
        (take,) = make_recordings(one, None, None, 0, None)
        assert curve.distance(take.desired_positions).max() < 1e-5
        assert curve.distance(take.tool_positions).max() < 1e-4
        positions = tool_positions(one)[0]
        assert np.allclose(positions, take.tool_positions, atol=1e-12)
        drawn = np.concatenate([line.get_xydata() for line in pc.tool_figure(one).axes[0].lines])
        center = np.array([0.4, 0.9])  # x and z are what it extends in
        assert np.abs(np.linalg.norm(1e-3 * drawn - center, axis=-1) - 0.08).max() < 2e-3


def test_a_run_whose_path_was_made_for_no_frame_asks_for_one(arm):
    task = pc.Circle(0.3, 0.3)
    run = pc.simulate(pc.ExtendedMotionPlan(arm, task, 900.0, [60.0, 100.0], 20.0), [0.3, 0.0], duration=0.1)
    with pytest.raises(pc.InputError, match="give frame="):
        tool_positions(run)
    assert tool_positions(run, frame="pen").shape == (1, len(run.time), 3)


def test_the_tool_is_shown_in_a_frame_of_its_own(arm, path):
    robot, frame = with_tool(arm, path, None)
    q = path.q_d(np.linspace(0, 0.4, 20))
    assert path.curve.distance(robot.frame_pose(q, frame)[:, :3, 3]).max() < 1e-5
    assert with_tool(robot, path, None)[1] == frame
    assert with_tool(arm, path, "link_2") == (arm, "link_2")


MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def limbs(lengths: dict[str, int]) -> pc.RobotModel:
    """Limbs of so many joints from one trunk, in the order of the file, and a scanner on the trunk last."""
    parts = ['<link name="trunk"/>']
    for limb, joints in lengths.items():
        for i in range(1, joints + 1):
            parent = "trunk" if i == 1 else f"{limb}{i - 1}"
            parts.append(f"""<link name="{limb}{i}">{MASS}</link><joint name="to_{limb}{i}" type="continuous">
              <parent link="{parent}"/><child link="{limb}{i}"/><origin xyz="0.3 0 0"/>
              <axis xyz="0 {i % 2} {1 - i % 2}"/><limit effort="9" velocity="9"/></joint>""")
        parts.append(f"""<link name="{limb}_end"/><joint name="on_{limb}" type="fixed"><parent link="{limb}{joints}"/>
          <child link="{limb}_end"/><origin xyz="0.1 0 0"/></joint>""")
    parts.append("""<link name="scanner"/><joint name="holds" type="fixed"><parent link="trunk"/>
      <child link="scanner"/></joint>""")
    return pc.load_robot(f'<robot name="limbs">{"".join(parts)}</robot>')


def test_of_many_limbs_the_longest_is_shown_or_the_one_that_the_path_moves():
    robot = limbs({"arm": 3, "leg": 2})
    assert default_tool(robot) == "arm_end"
    swing = np.zeros((2, robot.n))
    swing[1, [name.startswith("to_leg") for name in robot.joint_names]] = 0.5
    assert default_tool(robot, pc.Line(swing[0], swing[1], 0.1)) == "leg_end"


@pytest.mark.filterwarnings("ignore:.*principal moments")
@pytest.mark.parametrize(("name", "frame"), [("tiago_no_hand", "wrist_ft_tool_link"), ("ur5", "tool0")])
def test_known_arms_show_their_wrist(name, frame):
    pytest.importorskip("example_robot_data")
    assert default_tool(pc.load_robot(name)) == frame
