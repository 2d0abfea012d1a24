"""Visuals of a URDF are read as yourdfpy reads them, an independent reader."""

from __future__ import annotations

import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.view.bodies.body_shapes import Box, Cylinder
from pathcontrol.view.bodies.body_visuals import UNPAINTED, link_visuals

lengths = st.floats(1e-3, 10).map(repr)
signed = st.floats(-7, 7).map(repr)
gaps = st.sampled_from([" ", "  ", ",", ", "])
origins = st.one_of(
    st.just(""),
    st.just("<origin/>"),
    st.builds('<origin rpy="{} {} {}" xyz="{} {} {}"/>'.format, *[signed] * 6),
    st.builds('<origin xyz="{} {} {}"/>'.format, *[signed] * 3),
)
shares = st.floats(0, 1).map(repr)
materials = st.one_of(
    st.just(""),
    st.just('<material name="known"/>'),
    st.just('<material name="unknown"/>'),
    st.builds('<material name="known"><color rgba="{} {} {} {}"/></material>'.format, *[shares] * 4),
    st.builds('<material name=""><color rgba="{} {}  {} {} "/></material>'.format, *[shares] * 4),
)
shapes = st.one_of(
    st.builds('<box size="{0}{3}{1}{3}{2}"/>'.format, lengths, lengths, lengths, gaps),
    st.builds('<cylinder length="{}" radius="{}"/>'.format, lengths, lengths),
    st.builds('<sphere radius=" {} "/>'.format, lengths),
)
visuals = st.builds("<visual>{}<geometry><!-- a note -->{}</geometry>{}</visual>".format, origins, shapes, materials)


def robot(*parts: str) -> str:
    known = '<material name="known"><color rgba="0.1 0.2 0.3 1"/></material>'
    return f'<robot name="r">{known}<link name="l">{"".join(parts)}</link></robot>'


@given(st.lists(visuals, max_size=3))
def test_they_are_the_same(parts):
    text = robot(*parts)
    read = yourdfpy.URDF.load(BytesIO(text.encode()), build_scene_graph=False, load_meshes=False).robot.links[0].visuals
    found = link_visuals(UrdfSource(text))
    assert len(found) == len(read)
    for visual, expected in zip(found, read, strict=True):
        pose = np.eye(4) if expected.origin is None else expected.origin
        np.testing.assert_allclose(visual.origin, pose, rtol=1e-14, atol=1e-15)
        assert_same_shape(visual.shape, expected.geometry)
        material = expected.material
        known = (0.1, 0.2, 0.3, 1.0) if material is not None and material.name == "known" else UNPAINTED
        own = material is not None and material.color is not None
        assert visual.color == pytest.approx(material.color.rgba if own else known)


def assert_same_shape(shape, expected):
    if isinstance(shape, Box):
        np.testing.assert_array_equal(shape.size, expected.box.size)
    elif isinstance(shape, Cylinder):
        assert (shape.radius, shape.length) == (expected.cylinder.radius, expected.cylinder.length)
    else:
        assert shape.radius == expected.sphere.radius


@pytest.mark.parametrize("scale", ["", " ", "2", "1 2 3", "1, 2, 3"])
def test_meshes_are_scaled_alike(scale, tmp_path):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (tmp_path / "pyramid.obj").write_text("\n".join(lines))
    text = robot(f'<visual><geometry><mesh filename="pyramid.obj" scale="{scale}"/></geometry></visual>')
    read = yourdfpy.URDF.load(BytesIO(text.encode()), build_scene_graph=False, load_meshes=False).robot.links[0]
    factor = read.visuals[0].geometry.mesh.scale
    [visual] = link_visuals(UrdfSource(text, tmp_path))
    np.testing.assert_allclose(visual.shape.bounds[1], np.ones(3) * (1.0 if factor is None else factor))


@pytest.mark.parametrize(
    "geometry", ["", "<geometry/>", "<geometry><!-- none --></geometry>", "<geometry><cone/></geometry>"]
)
def test_what_is_no_shape_is_told(geometry):
    text = robot(f"<visual>{geometry}</visual>", '<visual><geometry><sphere radius="1"/></geometry></visual>')
    with pytest.warns(
        UserWarning, match="a visual of link 'l' is left out of the picture: it (has no geometry|is a <cone>)"
    ):
        assert len(link_visuals(UrdfSource(text))) == 1


def test_an_arm_of_simple_shapes_is_filmed_without_a_library_of_meshes(arm):
    assert parse_urdf(arm.source.text).find("link/visual/geometry/mesh") is None
    code = (
        "import sys, pathcontrol as pc; from pathcontrol.view.animation.record import record; "
        "from pathcontrol.view.bodies.body_visuals import link_visuals; "
        "assert link_visuals(pc.load_robot('cicese_2dof').source); print({'trimesh', 'yourdfpy'} & {*sys.modules})"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"
