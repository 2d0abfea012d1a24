"""Arms without masses: kinematics do, dynamics say what to do, and masses can be estimated or given."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ExperimentError, InputError, PathControlWarning, UrdfError
from pathcontrol.robot.lump import ball, combine, rod
from pathcontrol.robot.recipe import recipe_of, robot_of
from pathcontrol.robot.urdf import check_urdf, parse_urdf

SHAPES = {
    "box": ('<box size="0.2 0.3 0.6"/>', 0.2 * 0.3 * 0.6),
    "cylinder": ('<cylinder radius="0.1" length="0.5"/>', np.pi * 0.1**2 * 0.5),
    "sphere": ('<sphere radius="0.2"/>', 4 / 3 * np.pi * 0.2**3),
    "mesh": ('<mesh filename="block.stl" scale="0.2 0.3 0.6"/>', 0.2 * 0.3 * 0.6),
    "open mesh": ('<mesh filename="open.stl" scale="0.2 0.3 0.6"/>', 0.2 * 0.3 * 0.6),
}


@pytest.fixture
def folder(tmp_path):
    """A folder with a block of 1 m, and one whose last face is missing."""
    block = trimesh.creation.box()
    block.export(tmp_path / "block.stl")
    trimesh.Trimesh(block.vertices, block.faces[:-1]).export(tmp_path / "open.stl")
    return tmp_path


def arm(*inside: str, tail: str = "") -> str:
    """A chain of continuous joints 0.4 m apart, about y and z in turn."""
    links = "".join(f'<link name="l{i}">{content}</link>' for i, content in enumerate(inside))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="0 0 0.4"/>'
        f'<axis xyz="0 {i % 2} {1 - i % 2}"/><limit lower="-2" upper="2" effort="90" velocity="3"/></joint>'
        for i in range(1, len(inside))
    )
    return f'<robot name="bare">{links}{joints}{tail}</robot>'


def shape(what: str, tag: str = "visual", origin: str = "") -> str:
    return f"<{tag}>{origin}<geometry>{what}</geometry></{tag}>"


BARE = arm("", "", "", "", "", "", "")
EMPTY = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'


@pytest.mark.parametrize("text", [BARE, arm("", EMPTY, EMPTY, "", "", "", "")], ids=["none", "zero"])
def test_an_arm_without_masses_has_kinematics(text):
    report = check_urdf(text)
    assert report.ok
    assert [finding.code for finding in report.findings] == ["no-mass"]
    robot, q = pc.load_robot(text), np.array([0.4, 0.9, -0.3, 0.7, 0.2, 0.5])
    assert not robot.has_mass
    poses, jacobian = robot.frame_kinematics(q, "l6")
    step = 1e-6 * np.eye(6)
    by_difference = [(robot.frame_pose(q + h, "l6") - robot.frame_pose(q - h, "l6"))[:3, 3] / 2e-6 for h in step]
    np.testing.assert_allclose(jacobian[:3], np.transpose(by_difference), atol=1e-8)
    line = pc.ToolCurve.line(poses[:3, 3], poses[:3, 3] + [0.0, 0.0, -0.05])
    path = pc.CartesianPath(robot, "l6", line, speed=0.1, start=q)
    np.testing.assert_allclose(
        robot.frame_pose(path.q_d(path.s_end), "l6")[:3, 3], line.position(line.s_end), atol=1e-5
    )
    slow = path.with_profile(pc.limited(path, velocity=0.01 * robot.limits.velocity))
    s = np.linspace(path.s0, path.s_end, 50)
    assert np.abs(slow.dq_d(s) * slow.theta(s)[:, None]).max() == pytest.approx(0.03, rel=1e-2)


CALLS = {
    "mass_matrix": lambda robot, x: robot.mass_matrix(x),
    "inverse_dynamics": lambda robot, x: robot.inverse_dynamics(x, x, x),
    "inverse_dynamics of v": lambda robot, x: robot.inverse_dynamics(x, x, x, velocity=x),
    "forward_dynamics": lambda robot, x: robot.forward_dynamics(x, x, x),
    "gravity": lambda robot, x: robot.gravity(x),
    "coriolis_matrix": lambda robot, x: robot.coriolis_matrix(x, x),
    "kinetic_energy": lambda robot, x: robot.kinetic_energy(x, x),
    "potential_energy": lambda robot, x: robot.potential_energy(x),
    "with_payload": lambda robot, x: robot.with_payload(1.0, "l6"),
    "simulate": lambda robot, x: pc.simulate(
        pc.Projection(robot, pc.Line(0 * x, x + 1, 1.0), 100.0, 20.0), q=x, duration=0.1
    ),
    "time_optimal": lambda robot, x: pc.time_optimal(robot, pc.Line(0 * x, x + 1, 1.0)),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
def test_the_first_dynamic_call_says_in_one_line_what_to_do(call):
    with pytest.raises(UrdfError, match=r"no link has a mass.*with_masses\(kg=.*estimated_inertia=True") as caught:
        call(pc.load_robot(BARE), np.zeros(6))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize(("what", "volume"), SHAPES.values(), ids=SHAPES.keys())
def test_estimated_masses_are_those_of_solid_shapes(folder, tag, what, volume):
    file = folder / "arm.urdf"
    file.write_text(arm("", shape(what, tag, '<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.9"/>')))
    for choice, density in ((True, 1300.0), (2700.0, 2700.0)):
        robot = pc.load_robot(file, estimated_inertia=choice)
        body = robot.pinocchio_model.inertias[1]
        assert body.mass == pytest.approx(density * volume, rel=5e-3)
        np.testing.assert_allclose(body.lever, [0.1, 0.2, 0.3], atol=1e-6)
    if "box" in what or "mesh" in what:
        x, y, z = 0.2**2, 0.3**2, 0.6**2
        turn = pin.rpy.rpyToMatrix(0.3, -0.2, 0.9)
        inertia = turn @ np.diag([y + z, x + z, x + y]) @ turn.T * body.mass / 12
        np.testing.assert_allclose(body.inertia, inertia, atol=1e-6 * body.mass)


def test_only_what_is_missing_is_estimated(folder):
    known = EMPTY.replace('value="0"', 'value="7"').replace('ixx="0" iyy="0" izz="0"', 'ixx="0.1" iyy="0.1" izz="0.1"')
    block = shape(SHAPES["box"][0], "collision")
    flange = '<joint name="f" type="fixed"><parent link="l2"/><child link="tool"/></joint><link name="tool"/>'
    text = arm("", known + block, block + shape('<sphere radius="9"/>'), tail=flange)
    robot = pc.load_robot(text, estimated_inertia=True)
    assert [round(body.mass, 9) for body in list(robot.pinocchio_model.inertias)[1:]] == [7.0, round(1300 * 0.036, 9)]
    assert "tool" in robot.frame_names


def test_a_body_without_a_shape_becomes_a_ball_and_is_told(folder):
    text = arm("", shape('<mesh filename="none.stl"/>'), shape(SHAPES["box"][0]), "")
    with pytest.warns(PathControlWarning, match="no shape of l1, l3 can be read"):
        robot = pc.load_robot(text, estimated_inertia=True)
    M = robot.mass_matrix(np.random.default_rng(0).uniform(-2, 2, (50, 3)))
    assert (np.linalg.eigvalsh(M) > 0).all()


def test_an_estimate_is_kept_by_recipes_without_the_meshes(folder):
    file = folder / "arm.urdf"
    file.write_text(arm("", shape(SHAPES["mesh"][0]), shape(SHAPES["open mesh"][0])))
    robot = pc.load_robot(file, estimated_inertia=900.0)
    recipe = json.loads(json.dumps(recipe_of(robot)))
    for path in folder.iterdir():
        path.unlink()
    q = np.array([0.3, -0.7])
    np.testing.assert_array_equal(robot_of(recipe).mass_matrix(q), robot.mass_matrix(q))


@pytest.mark.parametrize("density", [0.0, -5.0, np.nan, "heavy"])
def test_a_density_is_a_positive_number(density):
    with pytest.raises(InputError, match="estimated_inertia"):
        pc.load_robot(BARE, estimated_inertia=density)


def test_masses_can_be_given_by_joint():
    robot = pc.load_robot(BARE)
    kg = {f"j{i}": 8.0 - i for i in range(1, 7)}
    heavy = robot.with_masses(kg=kg)
    assert [body.mass for body in list(heavy.pinocchio_model.inertias)[1:]] == list(kg.values())
    q = np.random.default_rng(0).uniform(-2, 2, (50, 6))
    assert (np.linalg.eigvalsh(heavy.mass_matrix(q)) > 0).all()
    twice = heavy.with_masses(kg={joint: 2 * mass for joint, mass in kg.items()})
    np.testing.assert_allclose(twice.mass_matrix(q), 2 * heavy.mass_matrix(q), rtol=1e-12)
    np.testing.assert_allclose(
        heavy.with_masses(dict.fromkeys(kg, 2.0)).mass_matrix(q), twice.mass_matrix(q), rtol=1e-12
    )
    np.testing.assert_array_equal(robot_of(json.loads(json.dumps(recipe_of(twice)))).gravity(q), twice.gravity(q))
    with pytest.raises(InputError, match=r"scale of j1 = 1.1: it moves no mass; say how many with kg="):
        robot.with_masses({"j1": 1.1})


@given(st.integers(0, 2**32 - 1))
def test_bodies_combine_as_pinocchio_adds_them(seed):
    rng = np.random.default_rng(seed)
    parts = [rod(rng.uniform(0.1, 9), rng.normal(size=3)) for _ in range(3)] + [ball(2.0, 0.1)]
    whole = combine(parts)
    total = sum((pin.Inertia(*part) for part in parts[1:]), pin.Inertia(*parts[0]))
    np.testing.assert_allclose(whole.mass, total.mass)
    np.testing.assert_allclose(whole.com, total.lever)
    np.testing.assert_allclose(whole.inertia, total.inertia, atol=1e-9)
    moments = np.linalg.eigvalsh(whole.inertia)
    assert moments[0] > 0
    assert moments[2] <= moments[:2].sum() * (1 + 1e-9)


def test_a_rod_is_a_solid_cylinder():
    mesh = trimesh.creation.cylinder(0.15 * 0.8, 0.8, sections=400)
    mesh.density = 5.0 / mesh.volume
    np.testing.assert_allclose(rod(5.0, np.array([0, 0, 0.8])).inertia, mesh.moment_inertia, rtol=1e-3, atol=1e-9)


# --- inertias that are nearly sound, and efforts below the weight ------------------------------------------------


def solid(mass: float, *moments: float) -> str:
    ixx, iyy, izz = moments
    return (
        f'<inertial><origin xyz="0.1 0 0.2"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def test_a_tiny_negative_moment_is_told_where_the_mass_matrix_is_positive_definite():
    text = arm("", solid(3, 0.1, 0.1, 0.05), solid(2, 0.03, 0.03, -2e-5))
    report = check_urdf(text)
    assert report.ok
    assert [finding.code for finding in report.warnings] == ["inertia-negative"]
    with pytest.warns(PathControlWarning, match="'l2': the principal moments are -2e-05"):
        robot = pc.load_robot(text)
    q = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    assert (np.linalg.eigvalsh(robot.mass_matrix(q)) > 0).all()


def test_a_negative_moment_that_counts_stays_an_error():
    on_axis = solid(2, 0.03, 0.03, -2e-5).replace("0.1 0 0.2", "0 0 0")
    for text in (
        arm("", solid(3, 0.1, 0.1, 0.05), solid(2, 0.03, 0.03, -0.02)),
        arm("", solid(3, 0.1, 0.1, 0.05), on_axis),  # about z, which joint 2 turns about
    ):
        assert "inertia-negative" in [finding.code for finding in check_urdf(text).errors]


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_dynamics_of_the_checks_are_those_of_pinocchio(seed):
    from pathcontrol.robot.urdf.model_values import moving_bodies, read_arm
    from pathcontrol.robot.urdf.posture_dynamics import gravity_torque, mass_matrix, postures

    rng = np.random.default_rng(seed)
    text = arm("", *(solid(rng.uniform(0.1, 5), *rng.uniform(0.01, 0.1, 3)) for _ in range(4)))
    text = text.replace('j3" type="revolute"', 'j3" type="prismatic"')
    text = text.replace('<origin xyz="0 0 0.4"/>', '<origin xyz="0.1 0.2 0.4" rpy="0.3 0.8 -0.4"/>')
    ends = '<parent link="l4"/><child link="hand"/><origin rpy="1 0 2" xyz="1 0 0"/>'
    flange = f'<joint name="f" type="fixed">{ends}</joint>'
    text = text.replace("</robot>", f'<link name="hand">{solid(1, 0.1, 0.1, 0.1)}</link>{flange}</robot>')
    values, robot = read_arm(parse_urdf(text)), pc.load_robot(text)
    q = postures(values, 10)
    M, g = mass_matrix(values, q), gravity_torque(values, q)
    order = [[body.joint.name for body in moving_bodies(values)].index(name) for name in robot.joint_names]
    np.testing.assert_allclose(M[:, order][:, :, order], robot.mass_matrix(q[:, order]), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(g[:, order], robot.gravity(q[:, order]), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("effort", "told"), [(1.9, False), (1.4, True), (0.5, True)])
def test_an_effort_below_the_weight_is_told(effort, told):
    """A pendulum of 1 kg at 0.15 m asks for 1.4715 N m."""
    body = solid(1, 0.01, 0.01, 0.01).replace("0.1 0 0.2", "0 0 0.15")
    text = arm("", body).replace('effort="90"', f'effort="{effort}"')
    found = [finding for finding in check_urdf(text).findings if finding.code == "effort-below-weight"]
    assert bool(found) == told
    if told:
        assert f"{effort:g} N m" in found[0].message
        assert "up to 1.47" in found[0].message


# --- experiment files and the command line ------------------------------------------------------------------------


def hand(multiplier: float = -0.5, offset: float = 0.1) -> str:
    """An arm of two joints with a gripper of two, of which j4 follows j3, and a third finger that follows j4."""
    mass = solid(1, 0.01, 0.01, 0.01)
    text = arm("", mass, mass, mass, mass, mass)
    for follower, leader in (("j4", "j3"), ("j5", "j4")):
        mimic = f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/></joint>'
        head, tail = text.split(f'name="{follower}"')
        text = f'{head}name="{follower}"' + tail.replace("</joint>", mimic, 1)
    return text


def test_experiment_files_say_what_is_locked_and_estimated(tmp_path):
    from pathcontrol.experiments.builders.arms import build_arms
    from pathcontrol.experiments.load import load_experiment

    (tmp_path / "hand.urdf").write_text(hand())
    (tmp_path / "bare.urdf").write_text(arm("", shape(SHAPES["box"][0]), shape(SHAPES["box"][0])))
    rest = """
[task]
type = "line"
start = [0.0, 0.0]
end = [0.1, 0.1]
speed = 0.1
[controller]
type = "projection"
k_p = 100.0
K_v = 20.0
"""
    q = np.array([0.3, -0.4])
    for robot, same in (
        ('source = "hand.urdf"\nkeep = ["j1", "j2"]', pc.load_robot(hand(), keep=["j1", "j2"])),
        ('source = "hand.urdf"\ntip = "l2"', pc.load_robot(hand(), tip="l2")),
        ('source = "hand.urdf"\nlock = { j3 = 0.4 }', pc.load_robot(hand(), lock={"j3": 0.4})),
        (
            'source = "bare.urdf"\nestimated_inertia = true',
            pc.load_robot(tmp_path / "bare.urdf", estimated_inertia=True),
        ),
        (
            'source = "bare.urdf"\nestimated_inertia = 500',
            pc.load_robot(tmp_path / "bare.urdf", estimated_inertia=500.0),
        ),
    ):
        (tmp_path / "a.toml").write_text(f"[robot]\n{robot}\n{rest}")
        model, plant = build_arms(load_experiment(tmp_path / "a.toml"), tmp_path)
        np.testing.assert_array_equal(model.mass_matrix(q), same.mass_matrix(q))
        np.testing.assert_array_equal(plant.mass_matrix(q), same.mass_matrix(q))
    for robot in ('keep = ["j9"]', 'tip = "nowhere"', "estimated_inertia = -1", 'estimated_inertia = "yes"'):
        (tmp_path / "a.toml").write_text(f'[robot]\nsource = "hand.urdf"\n{robot}\n{rest}')
        with pytest.raises(ExperimentError, match=robot.split(" ")[0]):
            build_arms(load_experiment(tmp_path / "a.toml"), tmp_path)


def test_the_check_locks_as_loading_does(tmp_path):
    (tmp_path / "hand.urdf").write_text(hand())
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box().export(tmp_path / "meshes" / "a.stl")
    text = arm(shape('<mesh filename="package://gone/meshes/a.stl"/>'), solid(1, 0.1, 0.1, 0.1))
    (tmp_path / "sub" / "urdf").mkdir(parents=True)
    (tmp_path / "sub" / "urdf" / "mesh.urdf").write_text(text)
    runner = CliRunner()
    for options in (["--lock", "j3"], ["--keep", "j1", "--keep", "j2"], ["--tip", "l2"]):
        done = runner.invoke(main, ["check", str(tmp_path / "hand.urdf"), *options])
        assert done.exit_code == 0
        assert "2 movable joints and 3 locked" in done.stdout
    assert runner.invoke(main, ["check", str(tmp_path / "hand.urdf")]).exit_code == 1
    done = runner.invoke(main, ["check", str(tmp_path / "hand.urdf"), "--tip", "l9"])
    assert done.exit_code == 2
    (tmp_path / "elsewhere.urdf").write_text(text.replace("meshes/", "parts/"))
    (tmp_path / "store" / "renamed" / "parts").mkdir(parents=True)
    (tmp_path / "meshes" / "a.stl").rename(tmp_path / "store" / "renamed" / "parts" / "a.stl")
    assert "mesh-missing" in runner.invoke(main, ["check", str(tmp_path / "elsewhere.urdf")]).stdout
    found = runner.invoke(main, ["check", str(tmp_path / "elsewhere.urdf"), "--package-dir", str(tmp_path / "store")])
    assert "mesh-missing" not in found.stdout


def test_an_experiment_file_says_how_to_give_masses_in_it(tmp_path):
    block = shape(SHAPES["box"][0])
    (tmp_path / "arm.urdf").write_text(arm("", block, block))
    text = (
        'duration = 0.01\n[robot]\nsource = "arm.urdf"\n{}\n[task]\ntype = "line"\nstart = [0.1, 0.1]\n'
        "end = [0.3, 0.2]\nspeed = 1.0\n"
        '[controller]\ntype = "projection"\nk_p = 100.0\nK_v = [20.0, 20.0]\n[start]\nq = [0.1, 0.1]\n'
    )
    (tmp_path / "bare.toml").write_text(text.format(""))
    with pytest.raises(ExperimentError, match=r"robot: no link of .* has a mass.*estimated_inertia = true") as caught:
        pc.run_experiment(tmp_path / "bare.toml", tmp_path / "out")
    assert "load_robot" not in str(caught.value)
    for advice in ("estimated_inertia = true", "estimated_inertia = 2700.0"):
        assert advice in str(caught.value)
        (tmp_path / "given.toml").write_text(text.format(advice))
        pc.run_experiment(tmp_path / "given.toml", tmp_path / "out")
