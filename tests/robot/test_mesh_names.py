"""Meshes are found as people name and keep them, and what is wrong with one is said in the same words everywhere."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlWarning, UrdfError
from pathcontrol.robot.urdf.mesh_files import find_mesh
from pathcontrol.view.bodies.body_visuals import link_visuals

ENVIRONMENT = ("ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "AMENT_PREFIX_PATH")
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"


def arm(*names: str, tag: str = "visual") -> str:
    """One joint, whose link has a mesh for each name."""
    shapes = "".join(f'<{tag}><geometry><mesh filename="{name}"/></geometry></{tag}>' for name in names)
    return (
        f'<robot name="r"><link name="a"/><link name="b">{shapes}</link><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
    )


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """A package with a cube of 1 m among its meshes, and nothing that the environment says."""
    for name in ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    folder = tmp_path / "src" / "arm_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes" / "Visual").mkdir(parents=True)
    trimesh.creation.box().export(folder / "meshes" / "Visual" / "upper arm.stl")
    return folder


def masses(file: Path, **options) -> float:
    """What the link weighs by its mesh, where nothing is warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return pc.load_robot(file, estimated_inertia=True, **options).pinocchio_model.inertias[1].mass


@pytest.mark.parametrize(
    "name",
    [
        "package://arm_description/meshes/Visual/upper arm.STL",
        "package://arm_description/Meshes/visual/Upper Arm.stl",
        "Package://other_name/meshes/Visual/upper%20arm.stl",
        "FILE:../meshes/Visual/upper arm.stl",
        " ../meshes/Visual/upper arm.stl ",
        "$(find arm_description)/meshes/Visual/upper arm.stl",
        "$(find-pkg-share arm_description)/meshes/Visual/upper arm.stl",
        "meshes/Visual/upper arm.stl",
        "/home/somebody/ws/src/arm_description/meshes/Visual/upper arm.stl",
        "file:///home/somebody/ws/src/arm_description/meshes/Visual/upper%20arm.stl",
        r"C:\Users\somebody\arm_description\meshes\Visual\upper arm.stl",
        r"file:///C:\Users\somebody\arm_description\meshes\visual\upper arm.STL",
    ],
)
def test_a_mesh_is_found_however_it_is_named(package, name):
    file = package / "urdf" / "arm.urdf"
    file.write_text(arm(name))
    assert masses(file) == pytest.approx(1300)
    assert len(link_visuals(pc.load_robot(file).source)) == 1
    assert [finding.code for finding in pc.check_urdf(file).findings if "mesh" in finding.code] == []


@pytest.mark.parametrize("name", ["package://p/meshes/Visual/m.stl", "meshes/Visual/m.stl", "/home/x/m.stl", "m.STL"])
def test_a_mesh_that_was_copied_beside_the_urdf_is_found(tmp_path, name):
    trimesh.creation.box().export(tmp_path / "m.stl")
    (tmp_path / "arm.urdf").write_text(arm(name))
    assert masses(tmp_path / "arm.urdf") == pytest.approx(1300)


def test_the_file_that_is_named_comes_before_those_that_resemble_it(package):
    for i, folder in enumerate(("meshes/Visual", "meshes/visual", "urdf", "meshes")):
        (package / folder).mkdir(exist_ok=True)
        trimesh.creation.box(np.full(3, 0.1 * (i + 1))).export(package / folder / "m.stl")
    for folder in ("meshes/Visual", "meshes/visual", "meshes"):
        found = find_mesh(f"package://arm_description/{folder}/m.stl", package / "urdf", ())
        assert found.samefile(package / folder / "m.stl")


@pytest.mark.parametrize(
    ("variable", "folder"),
    [
        ("ROS_PACKAGE_PATH", "src"),
        ("ROS_PACKAGE_PATH", "src/arm_description"),
        ("GAZEBO_MODEL_PATH", "src"),
        ("GZ_SIM_RESOURCE_PATH", "src"),
        ("AMENT_PREFIX_PATH", "install"),
    ],
)
def test_packages_are_looked_for_where_ros_and_gazebo_do(package, tmp_path, monkeypatch, variable, folder):
    (tmp_path / "install").mkdir()
    (tmp_path / "install" / "share").symlink_to(tmp_path / "src")
    (tmp_path / "home").mkdir()
    file = tmp_path / "home" / "arm.urdf"
    file.write_text(arm("package://arm_description/meshes/Visual/upper arm.stl"))
    with pytest.raises(UrdfError, match="ROS_PACKAGE_PATH"):
        find_mesh("package://arm_description/meshes/Visual/upper arm.stl", file.parent, ())
    monkeypatch.setenv(variable, f"/nowhere:{tmp_path / folder}")
    assert masses(file) == pytest.approx(1300)


def test_a_link_to_a_urdf_has_its_meshes_beside_it_or_beside_the_file(package, tmp_path):
    project = tmp_path / "project" / "urdf"
    project.mkdir(parents=True)
    trimesh.creation.box(np.full(3, 0.5)).export(project.parent / "own.stl")
    for name, mass in (("package://p/own.stl", 1300 / 8), ("../meshes/Visual/upper arm.stl", 1300)):
        (package / "urdf" / "arm.urdf").write_text(arm(name))
        link = project / "arm.urdf"
        link.unlink(missing_ok=True)
        link.symlink_to(package / "urdf" / "arm.urdf")
        assert masses(link) == pytest.approx(mass)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("m.stl", POINTER, "Git LFS and not .*git lfs pull"),
        ("m.stl", "", "empty file"),
        ("m.step", "ISO-10303-21;", r"ends in '\.step', expected one of \.stl"),
        ("none.stl", None, "put it there, or give the folder that its path begins in: package_dirs"),
        ("package://p/none.stl", None, "the folder that holds its package: package_dirs .* ROS_PACKAGE_PATH"),
        ("https://host/m.stl", None, "not fetched"),
    ],
)
def test_what_is_wrong_with_a_mesh_is_said_alike_everywhere(tmp_path, name, content, reason):
    if content is not None:
        (tmp_path / name).write_text(content)
    file = tmp_path / "arm.urdf"
    file.write_text(arm(name))
    (finding,) = [finding for finding in pc.check_urdf(file).findings if finding.code.startswith("mesh-")]
    with pytest.warns(UserWarning, match=reason) as drawn:
        assert link_visuals(pc.load_robot(file).source) == []
    with pytest.warns(PathControlWarning, match=reason) as estimated:
        pc.load_robot(file, estimated_inertia=True)
    said = finding.message.partition(": ")[2]
    assert all(said in str(one.message) for one in (*drawn, *estimated))
    assert "ball" in str(estimated[0].message)


def test_a_shape_that_a_mass_lacks_is_told_unless_another_stands_for_it(tmp_path):
    trimesh.creation.box().export(tmp_path / "m.stl")
    file = tmp_path / "arm.urdf"
    file.write_text(arm("m.stl", "none.stl"))
    with pytest.warns(PathControlWarning, match=r"the mass of b lacks shapes .*'none\.stl': it is not found"):
        pc.load_robot(file, estimated_inertia=True)
    seen = '<visual><geometry><mesh filename="m.stl"/></geometry></visual></link><joint'
    file.write_text(arm("none.stl", tag="collision").replace("</link><joint", seen))
    assert masses(file) == pytest.approx(1300)


@settings(max_examples=10)
@given(st.text(st.characters(blacklist_categories=("Cs",)), max_size=30), st.sampled_from(["", "file:", "package://"]))
def test_no_name_breaks_the_search(tmp_path_factory, text, scheme):
    folder = tmp_path_factory.getbasetemp()
    with pytest.raises(UrdfError, match="it is not found"):
        find_mesh(scheme + text + "/none-such.stl", folder, (folder,))


def test_a_long_name_is_looked_for_in_bounded_time(tmp_path):
    with pytest.raises(UrdfError, match="not found"):
        find_mesh("a/" * 100_000 + "m.stl", tmp_path, (tmp_path,))


def test_a_check_takes_the_path_of_a_file_and_asks_for_it(package):
    file = package / "urdf" / "arm.urdf"
    file.write_text(arm("../meshes/Visual/upper arm.stl", "none.stl"))
    report = pc.check_urdf(file)
    assert report.findings == pc.check_urdf(file.read_text(), base_dir=file.parent).findings
    assert "none.stl" in str(report.findings)
    assert "give Path('arm.urdf')" in pc.check_urdf("arm.urdf").errors[0].message
    assert "cannot be read" in pc.check_urdf(Path("nowhere.urdf")).errors[0].message
    with pytest.raises(InputError, match="text = 'None', expected the XML"):
        pc.check_urdf(None)
