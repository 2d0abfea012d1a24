"""Which files a robot is read from: its own, of bounded size, and meshes where people have them."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from pathcontrol import known_robots, load_robot
from pathcontrol.errors import UrdfError
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.catalogue import find_urdf, own_urdf
from pathcontrol.robot.meshes import load_parts
from pathcontrol.robot.urdf import check_urdf
from pathcontrol.view.bodies import body_meshes
from pathcontrol.view.bodies.body_meshes import cluster_vertices, read_mesh
from pathcontrol.view.bodies.body_visuals import link_visuals

# --- the robot that was asked for -----------------------------------------------------------------------------

#: lengths of upper arm and forearm [m], from the makers' tables of Denavit–Hartenberg parameters
UNIVERSAL = {"ur3": (0.24365, 0.21325), "ur5": (0.425, 0.39225), "ur10": (0.612, 0.5723)}


@pytest.mark.parametrize("name", [f"{arm}{kind}" for arm in UNIVERSAL for kind in ("", "_limited")])
def test_an_arm_has_the_lengths_its_maker_says(name):
    pytest.importorskip("example_robot_data")
    robot = load_robot(name)
    poses = robot.frame_poses(np.zeros(robot.n), ["upper_arm_link", "forearm_link", "wrist_1_link"])
    lengths = np.abs(np.diff(poses[:, [0, 2], 3], axis=0)).max(axis=1)
    np.testing.assert_allclose(lengths, UNIVERSAL[name.split("_")[0]], atol=1e-9)


def test_no_known_robot_calls_itself_as_another():
    pytest.importorskip("example_robot_data")
    known = known_robots()
    for name in known:
        own = ElementTree.fromstring(find_urdf(name).text.encode()).attrib["name"]
        assert own not in known or name.startswith(own)


def test_a_description_of_another_robot_is_not_taken(tmp_path):
    (tmp_path / "big.urdf").write_text('<robot name="big"/>')
    with pytest.raises(UrdfError, match=r"'small': its file .*big\.urdf' describes the robot 'big'"):
        own_urdf("small", tmp_path / "big.urdf", {"big", "small"})
    assert own_urdf("big_tool", tmp_path / "big.urdf", {"big", "big_tool"})[0].name == "big.urdf"
    (tmp_path / "small_robot.urdf").write_text('<robot xmlns:x="y" name="small"/>')
    assert own_urdf("small", tmp_path / "big.urdf", {"big", "small"})[0].name == "small_robot.urdf"


# --- bounds ---------------------------------------------------------------------------------------------------


def test_a_pipe_a_device_a_folder_and_twenty_gigabytes_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.urdf")
    with (tmp_path / "large.urdf").open("wb") as file:
        file.truncate(20 << 30)
    for path, reason in [
        (tmp_path / "pipe.urdf", "no regular file"),
        (Path("/dev/zero"), "no regular file"),
        (tmp_path, "no regular file"),
        (tmp_path / "large.urdf", "64 MiB"),
        (tmp_path / "a\0b.urdf", "null"),
    ]:
        with pytest.raises(UrdfError, match=reason):
            load_robot(path)


@pytest.mark.parametrize("suffix", [".zip", ".zae", ".3mf", ".step", ".tar.gz", "", ".npz", ".urdf"])
def test_meshes_are_of_a_list_of_formats(tmp_path, suffix):
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(trimesh.creation.box().export(file_type="stl"))
    with pytest.raises(UrdfError, match=r"expected one of \.stl, \.obj, \.ply, \.dae, \.glb, \.gltf"):
        load_parts(path)


def test_what_a_mesh_announces_or_names_is_bounded(tmp_path):
    accessor = '{"count": 2000000000, "type": "VEC3", "componentType": 5126}'
    primitive = '{"primitives": [{"attributes": {"POSITION": 0}}]}'
    (tmp_path / "bomb.gltf").write_text(
        f'{{"asset": {{"version": "2.0"}}, "accessors": [{accessor}], "meshes": [{primitive}], '
        '"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}'
    )
    with pytest.raises(UrdfError, match="announces 2000000000"):
        load_parts(tmp_path / "bomb.gltf")
    (tmp_path / "far.obj").write_text("mtllib /dev/zero\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (part,) = load_parts(tmp_path / "far.obj")
    assert len(part.faces) == 1
    os.mkfifo(tmp_path / "pipe.stl")
    with pytest.raises(UrdfError, match="no regular file"):
        load_parts(tmp_path / "pipe.stl")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("flat.obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"),
        ("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        ("back.ply", "0 0 0\n1 0 0\n0 1 0\n3 0 1 -7\n"),
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("huge.obj", "v 0 0 1e300\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ],
)
def test_triangles_without_corners_are_refused(tmp_path, name, text):
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / name).write_text((head if name.endswith("ply") else "") + text)
    with pytest.raises(UrdfError):
        read_mesh(tmp_path / name)


def test_a_dense_mesh_keeps_its_form_with_a_bounded_number_of_triangles():
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.3)  # 81 920 triangles
    few = cluster_vertices(ball, 20_000)
    assert len(few.faces) <= 20_000
    assert np.abs(np.linalg.norm(few.vertices, axis=1) - 0.3).max() < 0.01
    assert trimesh.Trimesh(few.vertices, few.faces).volume == pytest.approx(4 / 3 * np.pi * 0.3**3, rel=0.03)
    assert cluster_vertices(few, 20_000) is few


def test_loose_triangles_are_bounded_too(tmp_path, monkeypatch):
    rng, most = np.random.default_rng(0), 10_000
    monkeypatch.setattr(body_meshes, "MOST_TRIANGLES", most)
    corners = rng.uniform(-1, 1, (3 * most // 2, 1, 3)) + rng.normal(0, 1e-3, (3 * most // 2, 3, 3))
    trimesh.Trimesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3), process=False).export(
        tmp_path / "soup.stl"
    )
    [(mesh, _)] = read_mesh(tmp_path / "soup.stl")
    assert 0 < len(mesh.faces) <= most


def test_parts_are_where_their_file_puts_them(tmp_path):
    box, turn = trimesh.creation.box(), np.diag([-2.0, 1.0, 1.0, 1.0])  # mirrored
    turn[:3, 3] = 5, 0, 0
    scene = trimesh.Scene()
    scene.add_geometry(box, transform=turn)
    scene.export(tmp_path / "box.glb")
    (part,) = load_parts(tmp_path / "box.glb")
    np.testing.assert_allclose([part.vertices.min(0), part.vertices.max(0)], [[4, -0.5, -0.5], [6, 0.5, 0.5]])
    assert trimesh.Trimesh(part.vertices, part.faces, process=False).volume == pytest.approx(2.0)  # not inside out


# --- meshes as people name them -------------------------------------------------------------------------------


def arm(name: str, tag: str = "visual") -> str:
    """A robot with one mesh."""
    return (
        f'<robot name="r"><link name="a"><{tag}><geometry><mesh filename="{name}"/></geometry></{tag}></link>'
        '<link name="b"/><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
    )


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    """A home with a workspace, whose package has another name than the URDF says, and a mesh in it."""
    meshes = tmp_path / "src" / "arm_description-main" / "my meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.box().export(meshes / "upper.stl")
    (meshes.parent / "urdf").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def looks(name: str, home: Path, package_dirs: tuple[Path, ...] = ()) -> int:
    source = UrdfSource(arm(name), home / "src" / "arm_description-main" / "urdf", package_dirs)
    missing = [
        finding
        for finding in check_urdf(source.text, base_dir=source.base_dir, package_dirs=package_dirs).findings
        if finding.code == "mesh-missing"
    ]
    found = link_visuals(source)
    assert bool(found) != bool(missing)  # the check and the picture agree
    return len(found)


@pytest.mark.parametrize(
    "name",
    [
        "package://arm_description/my meshes/upper.stl",
        "package://arm_description/my%20meshes/upper.stl",
        "package://arm_description-main/my meshes/upper.stl",
        "model://arm_description/my%20meshes/upper.stl",
        r"package://arm_description\my meshes\upper.stl",
        r"..\my meshes\upper.stl",
        "../my%20meshes/upper.stl",
        "~/src/arm_description-main/my meshes/upper.stl",
        "file:~/src/arm_description-main/my meshes/upper.stl",
        "file:{home}/src/arm_description-main/my meshes/upper.stl",
        "file:///{home}/src/arm_description-main/my%20meshes/upper.stl",
        "file://{home}/src/arm_description-main/my%20meshes/upper.stl",
        "file://localhost{home}/src/arm_description-main/my%20meshes/upper.stl",
        "file:../my meshes/upper.stl",
        "file://../my meshes/upper.stl",
        "{home}/src/arm_description-main/my meshes/upper.stl",
    ],
)
def test_a_mesh_is_found_as_people_name_it(home, name):
    assert looks(name.format(home=home), home) == 1


def test_a_package_with_another_folder_is_found_among_the_package_dirs(home):
    elsewhere = UrdfSource(arm("package://arm_description/my meshes/upper.stl"), home / "else", (home / "src",))
    assert len(link_visuals(elsewhere)) == 1
    inside = UrdfSource(elsewhere.text, None, (home / "src" / "arm_description-main",))
    assert len(link_visuals(inside)) == 1


@pytest.mark.parametrize(
    "name", ["package://arm_description/none.stl", "~nobody-at-all/upper.stl", "a\x7f.stl", "http://h/m.stl"]
)
def test_a_mesh_that_is_nowhere_is_told_with_what_to_do(home, name):
    with pytest.warns(UserWarning, match=r"--package-dir|not fetched"):
        assert link_visuals(UrdfSource(arm(name), home)) == []


def test_a_pointer_of_git_lfs_is_told_as_such(home):
    (home / "m.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    (finding,) = [f for f in check_urdf(arm("m.stl"), base_dir=home).findings if f.code == "mesh-missing"]
    assert "git lfs pull" in finding.message
    with pytest.warns(UserWarning, match="git lfs pull"):
        assert link_visuals(UrdfSource(arm("m.stl"), home)) == []


def test_collision_meshes_that_are_missing_are_one_note(tmp_path):
    shapes = "".join(f'<collision><geometry><mesh filename="m{i}.stl"/></geometry></collision>' for i in range(9))
    report = check_urdf(arm("m.stl").replace('<link name="b"/>', f'<link name="b">{shapes}</link>'), base_dir=tmp_path)
    found = [finding for finding in report.findings if "mesh" in finding.code]
    assert [finding.code for finding in found] == ["mesh-missing", "collision-mesh-missing"]
    assert (found[1].level, "9 of 9" in found[1].message) == ("note", True)
