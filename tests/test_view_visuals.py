"""What a URDF shows comes out: every shape, where it belongs, or a warning that names what is missing."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pathcontrol.robot.model import UrdfSource
from pathcontrol.view.bodies.shapes import Box, Cylinder, Mesh, Sphere
from pathcontrol.view.bodies.sticks import stick_figure
from pathcontrol.view.bodies.visuals import leaf_links, link_visuals


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
        ("nowhere.stl", "no such file"),
        ("package://nowhere/it.stl", "no such file"),
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


def test_corners_enclose_the_shape() -> None:
    origin = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'
    [box] = link_visuals(UrdfSource(urdf(visual('<box size="2 4 6"/>', origin))))
    np.testing.assert_allclose([box.corners.min(0), box.corners.max(0)], [[-1, -1, -3], [3, 1, 3]], atol=1e-12)


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
