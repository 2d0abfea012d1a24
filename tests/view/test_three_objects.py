"""Scenes are written in the words of Meshcat's own package, byte for byte."""

from __future__ import annotations

import meshcat
import meshcat.geometry as meshes
import numpy as np
import pytest
import umsgpack

from pathcontrol.view.animation.scene.meshcat_commands import Scene, absolute
from pathcontrol.view.animation.scene.three_objects import BACK, BOTH
from pathcontrol.view.bodies.body_shapes import Box, Cylinder, Mesh, Sphere

RNG = np.random.default_rng(3)
SURFACE = Mesh(RNG.normal(size=(5, 3)), np.array([[0, 1, 2], [2, 3, 4]]))
POSE = RNG.normal(size=(4, 4))
COLOR, RGB = (0.2, 0.4, 0.6, 0.35), 0x336699
PARTS = {"color": RGB, "opacity": COLOR[3]}


class Window:
    """A window of Meshcat's, which keeps what it is sent, with numbers in place of its random names."""

    def __init__(self):
        self.sent = []

    def send(self, command):
        for number, part in enumerate(self.parts_of(command), start=1):
            part.uuid = str(number)
        self.sent.append(umsgpack.packb(command.lower(), force_float_precision="single"))

    @staticmethod
    def parts_of(command):
        thing = getattr(command, "object", None)
        return [] if thing is None else [thing, thing.geometry, thing.material]


def theirs(thing, place=None):
    """What Meshcat sends of a scene with one object, at a place if any."""
    window = Window()
    root = meshcat.Visualizer(window=window)
    for furniture in ("/Grid", "/Axes"):
        root[furniture].set_property("visible", False)
    root["a/b c"].set_object(thing)
    if place is not None:
        root["a/b c"].set_transform(place)
    return window.sent


@pytest.mark.parametrize(
    ("shape", "geometry"),
    [
        (Box(np.array([0.1, 0.2, 0.3])), meshes.Box([0.1, 0.2, 0.3])),
        (Sphere(0.2), meshes.Sphere(0.2)),
        (Cylinder(0.1, 0.5), meshes.Cylinder(0.5, 0.1)),
        (SURFACE, meshes.TriangularMeshGeometry(SURFACE.vertices, SURFACE.faces)),
    ],
    ids=["box", "sphere", "cylinder", "surface"],
)
def test_a_shape_at_a_pose(shape, geometry):
    scene = Scene()
    scene.add("a/b c", shape, COLOR, POSE)
    along = POSE @ meshcat.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]).round()
    place = along if isinstance(shape, Cylinder) else POSE
    assert scene.commands == theirs(meshes.Mesh(geometry, meshes.MeshPhongMaterial(side=2, **PARTS)), place)


@pytest.mark.parametrize(("lining", "side"), [(False, BOTH), (True, BACK)])
def test_a_line_of_one_colour(lining, side):
    scene = Scene()
    scene.add_line("a/b c", SURFACE, (*COLOR[:3], 1.0), lining=lining)
    material = meshes.MeshBasicMaterial(color=RGB, opacity=1.0, side=side)
    geometry = meshes.TriangularMeshGeometry(SURFACE.vertices, SURFACE.faces)
    assert scene.commands == theirs(meshes.Mesh(geometry, material))


def test_a_line_of_many_colours():
    scene, colors = Scene(), RNG.uniform(size=(5, 3))
    scene.add_colored_line("a/b c", SURFACE, colors)
    geometry = meshes.TriangularMeshGeometry(SURFACE.vertices, SURFACE.faces, colors)
    assert scene.commands == theirs(meshes.Mesh(geometry, meshes.MeshBasicMaterial(vertexColors=True, side=BOTH)))


def test_segments():
    scene, segments = Scene(), RNG.normal(size=(4, 2, 3))
    scene.add_segments("a/b c", segments, COLOR)
    ends = meshes.PointsGeometry(segments.reshape(-1, 3).T.astype(np.float32))
    assert scene.commands == theirs(meshes.LineSegments(ends, meshes.LineBasicMaterial(**PARTS)))


def test_paths_are_those_of_meshcat():
    assert meshcat.Visualizer(window=Window())["a/b c"].path.lower() == absolute("a/b c")
