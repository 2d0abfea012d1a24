"""What a URDF shows comes out: every shape, where it belongs, or a warning that names what is missing."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import load_robot
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.view.bodies.body_links import reach
from pathcontrol.view.bodies.body_meshes import round_vertices, thin
from pathcontrol.view.bodies.body_shapes import Box, Cylinder, Mesh, Sphere
from pathcontrol.view.bodies.body_visuals import leaf_links, link_visuals
from pathcontrol.view.bodies.sticks import stick_figure
from pathcontrol.view.bodies.tool_rods import tool_rods

seeds = st.integers(0, 2**32 - 1)


def visual(geometry: str, extra: str = "") -> str:
    return f"<visual>{extra}<geometry>{geometry}</geometry></visual>"


def urdf(*links: str) -> str:
    """A chain of links along x, each with the given content."""
    body = "".join(f'<link name="l{i}">{content}</link>' for i, content in enumerate(links))
    joints = "".join(
        f'<joint name="j{i}" type="continuous"><origin xyz="0.5 0 0"/><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for i in range(len(links) - 1)
    )
    return f'<robot name="r"><material name="red"><color rgba="1 0 0 0.5"/></material>{body}{joints}</robot>'


@pytest.fixture
def pyramid(tmp_path: Path) -> Path:
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    path = tmp_path / "shapes" / "meshes" / "pyramid.stl"
    path.parent.mkdir(parents=True)
    mesh.export(path)
    return path


def test_every_primitive_comes_out() -> None:
    shapes = ('<box size="1 2 3"/>', '<cylinder radius="0.1" length="2"/>', '<sphere radius="0.3"/>')
    box, cylinder, sphere = link_visuals(UrdfSource(urdf("".join(map(visual, shapes)))))
    assert isinstance(box.shape, Box)
    np.testing.assert_array_equal(box.shape.size, [1, 2, 3])
    assert cylinder.shape == Cylinder(0.1, 2.0)
    assert sphere.shape == Sphere(0.3)
    assert {box.link, cylinder.link, sphere.link} == {"l0"}


def test_collision_shapes_are_left_out() -> None:
    assert link_visuals(UrdfSource(urdf('<collision><geometry><sphere radius="1"/></geometry></collision>'))) == []


def test_the_origin_is_a_translation_after_a_roll_pitch_yaw_rotation() -> None:
    origin = '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>'
    [box] = link_visuals(UrdfSource(urdf(visual('<box size="1 1 1"/>', origin))))
    (cr, cp, cy), (sr, sp, sy) = np.cos([0.1, 0.2, 0.3]), np.sin([0.1, 0.2, 0.3])
    roll = [[1, 0, 0], [0, cr, -sr], [0, sr, cr]]
    pitch = [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]
    yaw = [[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]
    np.testing.assert_allclose(box.origin[:3, :3], np.array(yaw) @ pitch @ roll, atol=1e-12)
    np.testing.assert_array_equal(box.origin[:3, 3], [1, 2, 3])


def test_colours_are_found_by_name_and_inline() -> None:
    named = visual('<sphere radius="1"/>', '<material name="red"/>')
    inline = visual('<sphere radius="1"/>', '<material name="blue"><color rgba="0 0 1 1"/></material>')
    again = visual('<sphere radius="1"/>', '<material name="blue"/>')
    unknown = visual('<sphere radius="1"/>', '<material name="?"/>')
    colors = [v.color for v in link_visuals(UrdfSource(urdf(named + inline + again + unknown)))]
    assert colors[:3] == [(1, 0, 0, 0.5), (0, 0, 1, 1), (0, 0, 1, 1)]
    assert all(0 < channel <= 1 for channel in colors[3])


@pytest.mark.parametrize(
    "name", ["package://shapes/meshes/pyramid.stl", "meshes/pyramid.stl", "file://{path}", "{path}"]
)
def test_a_mesh_is_found_and_scaled(pyramid: Path, name: str) -> None:
    tag = f'<mesh filename="{name.format(path=pyramid)}" scale="1 2 -3"/>'
    source = UrdfSource(urdf(visual(tag, '<material name="red"/>')), pyramid.parent.parent, (pyramid.parents[2],))
    [found] = link_visuals(source)
    assert isinstance(found.shape, Mesh)
    assert len(found.shape.faces) == 4
    np.testing.assert_allclose(found.shape.bounds, [[0, 0, -3], [1, 2, 0]])
    assert found.color == (1, 0, 0, 0.5)


def test_a_package_is_found_beside_the_urdf(pyramid: Path) -> None:
    folder = pyramid.parents[1] / "urdf" / "deep"
    source = UrdfSource(urdf(visual('<mesh filename="package://shapes/meshes/pyramid.stl"/>')), folder)
    assert len(link_visuals(source)) == 1


def test_smooth_surfaces_share_vertices_and_edges_do_not(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.stl")
    trimesh.creation.box().export(tmp_path / "box.stl")
    tags = '<mesh filename="ball.stl"/>', '<mesh filename="box.stl"/>'
    ball, box = link_visuals(UrdfSource(urdf("".join(map(visual, tags))), tmp_path))
    assert (len(ball.shape.vertices), len(ball.shape.faces)) == (642, 1280)
    assert (len(box.shape.vertices), len(box.shape.faces)) == (24, 12)


def test_the_colours_inside_a_mesh_win_and_split_it(tmp_path: Path) -> None:
    parts = [trimesh.creation.box(), trimesh.creation.box()]
    for part, color in zip(parts, ([255, 0, 0, 255], [0, 0, 255, 255]), strict=True):
        part.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=color))
    trimesh.Scene(parts).export(tmp_path / "two.glb")
    found = link_visuals(UrdfSource(urdf(visual('<mesh filename="two.glb"/>', '<material name="red"/>')), tmp_path))
    assert [v.color for v in found] == [(0, 0, 1, 1), (1, 0, 0, 1)]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("nowhere.stl", "it is not found"),
        ("package://nowhere/it.stl", "it is not found"),
        ("https://example.org/it.stl", "not fetched"),
        ("text.stl", "no triangles"),
        ("text.dae", "cannot be read"),
        ("empty.stl", ""),
    ],
)
def test_a_mesh_that_cannot_be_had_is_named_in_a_warning(tmp_path: Path, name: str, reason: str) -> None:
    for suffix in ("stl", "dae"):
        (tmp_path / f"text.{suffix}").write_text("this is no mesh")
    (tmp_path / "empty.stl").write_bytes(bytes(80) + struct.pack("<I", 0))
    text = urdf(visual(f'<mesh filename="{name}"/>') + visual('<sphere radius="1"/>'))
    with pytest.warns(UserWarning, match=f"{name}.*'l0'.*{reason}"):
        found = link_visuals(UrdfSource(text, tmp_path))
    assert [v.shape for v in found] == [Sphere(1.0)]


@pytest.mark.parametrize("broken", ["", '<box size="a b c"/>', "<box/>", '<torus radius="1"/>', '<box size="1 2"/>'])
def test_a_broken_visual_costs_no_other(broken: str) -> None:
    with pytest.warns(UserWarning, match="'l0'"):
        found = link_visuals(UrdfSource(urdf(visual(broken) + visual('<sphere radius="1"/>'))))
    assert [v.shape for v in found] == [Sphere(1.0)]


def test_the_outline_of_a_box_is_its_corners() -> None:
    origin = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'
    [box] = link_visuals(UrdfSource(urdf(visual('<box size="2 4 6"/>', origin))))
    np.testing.assert_allclose([box.outline.min(0), box.outline.max(0)], [[-1, -1, -3], [3, 1, 3]], atol=1e-12)


@given(seeds)
def test_outlines_reach_as_far_as_their_shapes_in_every_direction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    direction, radius, length = rng.normal(size=3), *rng.uniform(0.1, 2, size=2)
    direction /= np.linalg.norm(direction)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    across = radius * np.hypot(*direction[:2])
    reached = {
        Sphere(radius): radius,
        Cylinder(radius, length): across + length / 2 * abs(direction[2]),
        Mesh(ball.vertices, ball.faces): radius,
    }
    for shape, support in reached.items():
        assert 0.9 * support <= (shape.outline @ direction).max() <= support * (1 + 1e-9)
        assert (np.abs(shape.outline) <= shape.bounds[1] * (1 + 1e-6)).all()


# --- thinning -----------------------------------------------------------------------------------------------


def away(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Distance of points (k, 3) from the nearest triangle of a mesh, (k,)."""
    triangles = mesh.vertices[mesh.faces]
    centers = triangles.mean(axis=1)
    off = np.linalg.norm(points[:, None] - centers, axis=-1)  # (point, triangle)
    reach = np.linalg.norm(triangles - centers[:, None], axis=-1).max(axis=1)
    i, k = np.nonzero(off - reach <= off.min(axis=1, keepdims=True))  # others are farther away than a center
    nearest, found = trimesh.triangles.closest_point(triangles[k], points[i]), np.full(len(points), np.inf)
    np.minimum.at(found, i, np.linalg.norm(nearest - points[i], axis=-1))
    return found


def bumpy(seed: int) -> Mesh:
    """A closed smooth body without any symmetry."""
    rng, ball = np.random.default_rng(seed), trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    waves = sum(rng.uniform(0, 0.06) * np.sin(ball.vertices @ rng.normal(0, 2, 3) + k) for k in range(4))
    vertices = ball.vertices * (1 + waves)[:, None] * rng.uniform(0.1, 1, 3)
    return Mesh(vertices, ball.faces)


@settings(max_examples=8)
@given(seeds, st.floats(1e-4, 2e-2))
def test_a_thinned_surface_is_near_the_whole_one_and_the_other_way_round(seed: int, detail: float) -> None:
    whole = bumpy(seed)
    fewer = thin(whole, detail)
    assert len(fewer.faces) <= len(whole.faces)
    assert away(fewer.vertices[:200], whole).max() <= detail
    assert away(whole.vertices[::5], fewer).max() <= detail
    assert trimesh.Trimesh(fewer.vertices, fewer.faces).is_watertight


def test_flat_and_fine_parts_lose_most_of_their_triangles() -> None:
    box = trimesh.creation.box()
    for _ in range(4):
        box = box.subdivide()
    few = thin(Mesh(box.vertices, box.faces), 1e-4)
    assert len(few.faces) < len(box.faces) / 10
    np.testing.assert_allclose(few.bounds, [[-0.5] * 3, [0.5] * 3], atol=1e-4)
    ball = trimesh.creation.icosphere(subdivisions=5)
    assert len(thin(Mesh(ball.vertices, ball.faces), 1e-2).faces) < len(ball.faces) / 2


def test_borders_and_what_is_small_stay() -> None:
    x, y = np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 1, 11))
    grid = np.arange(121).reshape(11, 11)
    squares = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    sheet = Mesh(
        np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), np.concatenate([squares[:, :3], squares[:, [0, 2, 3]]])
    )
    fewer = thin(sheet, 1e-2)
    assert len(fewer.faces) < len(sheet.faces)
    rim = {tuple(p) for p in sheet.vertices.round(6) if {0.0, 1.0} & set(p[:2])}
    assert rim <= {tuple(p) for p in fewer.vertices.round(6)}
    lamp = trimesh.creation.box([1e-3] * 3)
    np.testing.assert_array_equal(thin(Mesh(lamp.vertices, lamp.faces), 0.1).vertices, lamp.vertices)


@given(seeds, st.floats(1e-6, 1.0))
def test_rounding_is_far_finer_than_the_detail_and_shortens_numbers(seed: int, detail: float) -> None:
    mesh = bumpy(seed)
    short = round_vertices(mesh, detail)
    assert np.abs(short.vertices - mesh.vertices).max() <= detail / 32
    step = 2.0 ** np.floor(np.log2(detail / 16))
    np.testing.assert_array_equal(np.mod(short.vertices, step), 0)


def test_without_a_detail_a_mesh_is_left_alone() -> None:
    mesh = bumpy(0)
    assert thin(mesh, 0.0) is mesh
    assert round_vertices(mesh, 0.0) is mesh


def test_visuals_are_thinned_by_a_share_of_the_reach(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=5, radius=0.2).export(tmp_path / "ball.stl")
    text = urdf(visual('<mesh filename="ball.stl"/>'), "", "", "")
    assert reach(UrdfSource(text)) == pytest.approx(1.5)
    [whole], [fewer] = (link_visuals(UrdfSource(text, tmp_path), fineness) for fineness in (0.0, 5e-4))
    assert len(fewer.shape.faces) < len(whole.shape.faces) / 2
    radii = np.linalg.norm(fewer.shape.vertices, axis=-1)
    assert np.abs(radii - 0.2).max() <= 7.5e-4 * 1.1


def test_leaves_carry_nothing() -> None:
    assert leaf_links(UrdfSource(urdf("", "", ""))) == {"l2"}


def test_sticks_reach_from_joint_to_joint() -> None:
    sticks = [v for v in stick_figure(UrdfSource(urdf("", "", ""))) if v.name == "stick"]
    assert [v.link for v in sticks] == ["l0", "l1"]
    for stick in sticks:
        ends = stick.origin @ np.array([[0, 0, -stick.shape.length / 2, 1], [0, 0, stick.shape.length / 2, 1]]).T
        np.testing.assert_allclose(ends.T[:, :3], [[0, 0, 0], [0.5, 0, 0]], atol=1e-12)


def test_the_bundled_arm_is_shown_without_warnings(arm) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert {v.link for v in link_visuals(arm.source)} == {"base", "link_1", "link_2"}


@given(seeds)
@settings(max_examples=10)
def test_an_added_frame_is_shown_by_a_rod_from_its_parent(seed: int) -> None:
    """The ends of the rod are the origins of both frames, in any posture; on a frame that was added, too."""
    rng = np.random.default_rng(seed)
    arm = load_robot("cicese_2dof")
    end, (first, second) = arm.frame_names[-1], rng.uniform(-0.2, 0.2, (2, 3))
    arm = arm.with_frame("holder", end, first).with_frame("cutter", "holder", second)
    rods = {rod.name: rod for rod in tool_rods(arm)}
    for name, parent, position in (("tool holder", end, first), ("tool cutter", "holder", second)):
        rod = rods[name]
        assert rod.link == parent
        axis = 0.5 * rod.shape.length * rod.origin[:3, 2]
        np.testing.assert_allclose(
            [rod.origin[:3, 3] - axis, rod.origin[:3, 3] + axis], [np.zeros(3), position], atol=1e-12
        )
        assert rod.shape.radius < 0.1 * rod.shape.length


def test_no_rod_without_a_tool_or_its_length() -> None:
    """A frame at the origin of its parent has no rod, and one that stands still is no tool."""
    arm = load_robot("cicese_2dof")
    assert tool_rods(arm) == []
    assert tool_rods(arm.with_frame("here", arm.frame_names[-1], [0, 0, 0])) == []
    assert tool_rods(arm.with_frame("workpiece", arm.frame_names[0], [0.3, 0, 0])) == []
