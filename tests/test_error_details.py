"""What an error is about stands beside its message, for programs that react to it."""

from __future__ import annotations

import ast
import functools
import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc
from pathcontrol import errors


class Backwards(pc.PathTask):
    s_end = 1.0

    def q_d(self, s):
        return np.stack([s, s], axis=-1)

    def theta(self, s):
        return 0.5 - s


def raised(kind, call):
    with pytest.raises(kind) as caught:
        call()
    return caught.value


def test_arguments_are_named_with_their_values(arm, circle):
    error = raised(pc.InputError, lambda: pc.Circle(-1.0, 2.0))
    assert (error.argument, error.value) == ("radius", -1.0)
    error = raised(pc.InputError, lambda: pc.SampledLoop(period=np.nan))
    assert error.argument == "period"
    assert np.isnan(error.value)
    error = raised(pc.InputError, lambda: pc.Projection("ur5", circle, 800.0, 45.0))
    assert error.value == "ur5"
    error = raised(pc.UnknownNameError, lambda: arm.frame_pose(np.zeros(2), "gripper"))
    assert error.value == "gripper"
    assert set(error.choices) == set(arm.frame_names)


def test_places_on_a_path_are_told(circle):
    error = raised(pc.TaskError, lambda: pc.check_task(Backwards(), 2))
    assert 0.5 <= error.s <= 1.0
    assert error.value == pytest.approx(0.5 - error.s)
    error = raised(pc.InputError, lambda: pc.arc_length(pc.Line([0.0, 0.0], [1.0, 0.0], 1.0), 0.0, 7.0))
    assert (error.argument, error.value, error.limit[0]) == ("s_end", 7.0, 0.0)


def test_a_joint_at_its_limit_is_told():
    """A start posture may not be beyond the limits of a joint."""
    robot = pc.load_robot("panda", lock={"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})
    q = np.clip(np.zeros(7), robot.limits.lower, robot.limits.upper)
    q[0] = robot.limits.upper[0] + 0.1
    curve = pc.ToolCurve.line([0.5, 0.0, 0.3], [0.5, 0.1, 0.3])
    error = raised(pc.InputError, lambda: pc.CartesianPath(robot, "panda_hand", curve, 0.1, start=q))
    assert (error.argument, error.joint, error.value) == ("start", robot.joint_names[0], q[0])
    assert error.limit == (robot.limits.lower[0], robot.limits.upper[0])


@functools.cache
def robot():
    return pc.load_robot("cicese_2dof")


@functools.cache
def run():
    law = pc.Projection(robot(), pc.Circle(1.0, 2.0), 800.0, 45.0)
    return pc.simulate(law, [1.0, 0.1], duration=0.05, loop=pc.SampledLoop(), progress=False)


def law(task=None, **options):
    return pc.Projection(robot(), pc.Circle(1.0, 2.0) if task is None else task, 800.0, 45.0, **options)


def simulated(**options):
    options = {"duration": 0.05, "progress": False} | options
    return pc.simulate(law(), [1.0, 0.1], **options)


LINE = pc.Line([0.0, 0.0], [0.6, 0.4], 1.0)
POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
#: calls that are refused, with the argument and the value that are to blame
REFUSED = [
    # robot
    (lambda: robot().with_payload(-1.0, "tool"), "mass", -1.0),
    (lambda: robot().with_payload(1.0, "tool", com=[0.0, 1.0]), "com", [0.0, 1.0]),
    (lambda: robot().with_armature([1.0, -2.0]), "armature", [1.0, -2.0]),
    (lambda: robot().with_masses(kg={"joint_1": -3.0}), "kg", -3.0),
    (lambda: robot().with_masses(scale=[1.0]), "scale", [1.0]),
    (lambda: robot().with_frame("tool", "tool", [0.0, 0.0, 0.0]), "name", "tool"),
    (lambda: robot().with_frame("tip", "tool", [0.0, 0.0]), "pose", [0.0, 0.0]),
    (lambda: pc.load_robot("cicese_2dof", lock=["joint_2"]), "lock", ["joint_2"]),
    (lambda: robot().reduced({"elbow": 0.0}), None, "elbow"),
    (lambda: robot().reduced(keep=3), "keep", 3),
    (lambda: robot().reduced(tip=["tool"]), "tip", ["tool"]),
    (lambda: pc.Viscous([1.0, -1.5]), "coefficients", [1.0, -1.5]),
    (lambda: pc.Stribeck([-1.0], [0.5], [0.1]), "coulomb", [-1.0]),
    (lambda: pc.Stribeck([1.0], [0.5], [0.1]), "static", [0.5]),
    (lambda: pc.Stribeck([1.0], [1.5], [math.nan]), "velocity", math.nan),
    (lambda: robot().mass_matrix([1.0, 2.0, 3.0]), "q", [1.0, 2.0, 3.0]),
    (lambda: pc.check_urdf(5), "text", 5),
    (lambda: pc.load_robot(5), "robot", 5),
    (lambda: pc.load_robot("cicese_2dof", package_dirs=5), "package_dirs", 5),
    # tasks
    (lambda: pc.Ellipse([1.0, -2.0], 1.0), "semi_axes", [1.0, -2.0]),
    (lambda: pc.Circle(1.0, 1.0, joints=(0, 2)), "joints", (0, 2)),
    (lambda: pc.Lissajous([1.0, 1.0], [1.5, 2.0], 1.0), "frequencies", [1.5, 2.0]),
    (lambda: pc.Line([0.0, 0.0], [0.0, 0.0], 1.0), "end", [0.0, 0.0]),
    (lambda: pc.Line([[0.0]], [0.0], 1.0), "start", [[0.0]]),
    (lambda: pc.FunctionPath(3.0, 1.0, s_end=1.0), "function", 3.0),
    (lambda: pc.FunctionPath(np.sin, 1.0, s_end=-1.0), "s_end", -1.0),
    (lambda: pc.SymbolicPath("cos(s)", speed=1.0, period=1.0), "q_d", "cos(s)"),
    (lambda: pc.SymbolicPath(["cos(s)"], speed=1.0, s="2s", s_end=1.0), None, "2s"),
    (lambda: pc.SymbolicPath(["Abs(s)", "s"], speed=1.0, s_end=1.0), "q_d[0]", "Abs(s)"),
    (lambda: pc.WaypointPath([[0.0, 0.0]], 1.0), "points", [[0.0, 0.0]]),
    (lambda: pc.WaypointPath([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]], 1.0), "points", [0.0, 0.0]),
    (lambda: pc.WaypointPath(np.eye(3), 1.0, parametrisation=[0.0, 2.0, 1.0]), "parametrisation", [0.0, 2.0, 1.0]),
    (lambda: LINE.shifted([1.0]), "offset", [1.0]),
    (lambda: LINE.scaled(0.0), "factor", 0.0),
    (lambda: LINE.between(0.5, 0.25), "s_end", 0.25),
    (lambda: pc.TaskBatch([]), "tasks", []),
    (lambda: pc.concatenated([LINE, 7]), "paths[1]", 7),
    (lambda: pc.SplinePath.from_samples([[0.0], [1.0]], 1.0, 0.1, s=[0.0, -1.0]), "s", -1.0),
    (lambda: pc.check_task(5, 2), "task", 5),
    # profiles
    (lambda: pc.TabulatedProfile([0.0, 0.5, 0.25], [1.0, 1.0, 1.0]), "s", 0.25),
    (lambda: pc.TabulatedProfile([0.0, 1.0], [1.0, -4.0]), "squared", -4.0),
    (lambda: pc.limited(LINE, velocity=[1.0, -1.0]), "velocity", [1.0, -1.0]),
    (lambda: pc.time_optimal(robot(), LINE, margin=1.5), "margin", 1.5),
    (lambda: pc.time_optimal(robot(), LINE, velocity=[1.0, -2.0]), "velocity", -2.0),
    (lambda: pc.time_optimal(robot(), LINE, acceleration=True), "acceleration", True),
    (lambda: pc.ConstantSpeed(-1.0), "speed", -1.0),
    # control
    (lambda: pc.Projection(robot(), LINE, 0.0, 1.0), "k_p", 0.0),
    (lambda: pc.PDPlus(robot(), LINE, [1.0, -3.0], 1.0), "K_p", [1.0, -3.0]),
    (lambda: pc.ExtendedMotionPlan(robot(), LINE, 1.0, 1.0, -2.0), "k", -2.0),
    (lambda: law(friction="dry"), "friction", "dry"),
    (lambda: pc.PathMPC(robot(), LINE, margin=1.0), "margin", 1.0),
    (lambda: pc.SpeedOverride(law(), -30.0), "override", -30.0),
    (lambda: pc.SpeedOverride(law(), [[1.0, 1.0], [0.5, 0.0]]), "override", [1.0, 0.5]),
    (lambda: pc.Paced(law(), torque_margin=1.25), "torque_margin", 1.25),
    (lambda: pc.Learned(law(), learning_gain=2.0), "learning_gain", 2.0),
    (lambda: pc.PassiveVelocityField(robot(), LINE, 1.0, 1.0, recharge=-1.0), "recharge", -1.0),
    # cartesian
    (lambda: pc.FixedOrientation([1.0, 1.0, 0.0, 0.0]), "rotation", [1.0, 1.0, 0.0, 0.0]),
    (lambda: pc.TangentOrientation([0.0, 0.0, 0.0]), "up", [0.0, 0.0, 0.0]),
    # toolpaths
    (lambda: pc.ToolCurve.line([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), "end", [1.0, 2.0, 3.0]),
    (lambda: pc.ToolCurve.line([1.0, 2.0], [1.0, 2.0, 3.0]), "start", [1.0, 2.0]),
    (lambda: pc.ToolCurve.spline(POINTS), "points", POINTS),
    (lambda: pc.read_toolpath(3.5), "path", 3.5),
    # simulation
    (lambda: simulated(duration=-2.0), "duration", -2.0),
    (lambda: simulated(loop="fast"), "loop", "fast"),
    (lambda: simulated(plant=[]), "plant", []),
    (lambda: simulated(disturbance=4), "disturbance", 4),
    (lambda: simulated(laps=0), "laps", 0),
    (lambda: simulated(engine="warp"), "engine", "warp"),
    (lambda: simulated(loop=pc.SampledLoop(delay=1.0)), "delay", 1.0),
    (lambda: pc.SampledLoop(substeps=0), "substeps", 0),
    (lambda: pc.SampledLoop(velocity="guess"), "velocity", "guess"),
    (lambda: pc.SampledLoop(noise=0.1), "noise", 0.1),
    (lambda: pc.SensorNoise(position=-0.5), "position", -0.5),
    (lambda: pc.SensorNoise(seed=-1), "seed", -1),
    (lambda: pc.Push([1.0, 1.0], start=0.0, duration=-1.0), "duration", -1.0),
    (lambda: pc.JammedJoint(-1, 0.0), "joint", -1),
    (lambda: pc.Wall("tool", [0, 0, 0], [0, 0, 0]), "normal", [0, 0, 0]),
    (lambda: pc.simulate_sequence(3, [0.0, 0.0], duration=1.0), "controllers", 3),
    (lambda: run().rollout(7), None, 7),
    (lambda: run()["speed"], None, "speed"),
    (lambda: run().to_trajectory(100.0, rollout=9), "rollout", 9),
    (lambda: pc.Run.load(b"a.nc"), "path", b"a.nc"),
    # analysis
    (lambda: pc.metrics(run(), window="most"), "window", "most"),
    (lambda: pc.metrics(run(), fraction=1.5), "fraction", 1.5),
    (lambda: pc.non_dominated([1.0, 2.0]), "values", [1.0, 2.0]),
    (lambda: pc.stability_map(law(), []), "gains", []),
    (lambda: pc.stability_map(law(), {"k_p": [5.0, 5.0]}), "k_p", [5.0, 5.0]),
    # sweeps, tuning
    (lambda: pc.Space.grid({}), "parameters", {}),
    (lambda: pc.Space.grid({"k": [1.0, math.inf]}), "k", math.inf),
    (lambda: pc.Space.random({"k": [1.0, 2.0]}, samples=-3), "samples", -3),
    (lambda: pc.Keep(worst=-1), "keep.worst", -1),
    (lambda: pc.SweepResult(7), "folder", 7),
    (lambda: pc.sweep(dict, pc.Space.grid({"k": [1.0]}), out=7), "out", 7),
    # comparison, view, experiments
    (lambda: pc.run_experiment(3, "out"), "path", 3),
    (lambda: pc.make_scenario("moon"), "scenario", "moon"),
    (lambda: pc.save_figure(3, "a.svg"), "figure", 3),
    (lambda: pc.record(3), "run", 3),
    (lambda: pc.report([], "run.html"), "runs", []),
    (lambda: pc.figures.phase_figure(run(), joints=[0, 5]), "joints", [0, 5]),
    (lambda: pc.save_video(pc.record(run()), 3.5), "path", 3.5),
    # hardware
    (lambda: pc.Envelope(torque=[1.0, -1.0]), "torque", [1.0, -1.0]),
    (lambda: pc.Envelope(late=4.0, lost=2.0), "late", 4.0),
    (lambda: pc.ControlLoop(law(), -0.5), "period", -0.5),
    (lambda: pc.drive(3, 4, 1.0), "loop", 3),
]


def test_arguments_behind_other_words_are_named():
    """A message may call an argument by what it is; beside it stands the name of the parameter."""
    error = raised(pc.InputError, lambda: pc.Coulomb([1.0, 2.0], [-1.0, 2.0]))
    assert (error.argument, error.value) == ("minus", [-1.0, 2.0])
    error = raised(pc.InputError, lambda: pc.load_robot("cicese_2dof", lock={"joint_2": math.inf}))
    assert (error.argument, error.joint, error.value) == ("lock", "joint_2", math.inf)
    error = raised(pc.InputError, lambda: robot().with_masses(kg={"joint_1": 0.0}))
    assert (error.argument, error.joint, error.value) == ("kg", "joint_1", 0.0)
    error = raised(pc.InputError, lambda: pc.PathSequence([LINE, pc.Line([5.0, 0.0], [6.0, 0.0], 1.0)]))
    assert error.argument == "paths[1]"
    assert error.limit < error.value == pytest.approx(4.4)
    error = raised(pc.InputError, lambda: pc.report(run(), "run.txt"))
    assert (error.argument, error.value, error.file) == ("out", "run.txt", "run.txt")
    error = raised(pc.InputError, lambda: pc.PathSequence([pc.TaskBatch([LINE, LINE])]))
    assert error.argument == "paths[0]"


def stands_in(message, value):
    """Return whether a message shows a value, or the shape of an array whose shape is wrong."""
    forms = {repr(value), str(value), repr(value)[:80]}
    forms |= {f"{value:g}"} if isinstance(value, float) else set()
    forms |= {f"shape {np.shape(value)}"} if isinstance(value, list) else set()
    return any(form in message for form in forms) or "empty" in message


@pytest.mark.parametrize(("call", "argument", "value"), REFUSED, ids=[f"{a}-{v!r:.20}" for _, a, v in REFUSED])
def test_what_a_message_says_stands_beside_it(call, argument, value):
    """The argument is the name that the user wrote, the value is what was given, as Python has it."""
    error = raised(pc.PathControlError, call)
    assert (error.argument, type(error.value)) == (argument, type(value)), error
    assert_array_equal(error.value, value)
    assert argument is None or argument in str(error)
    assert stands_in(str(error), value), error


#: errors of the package that say nothing but their message; a new one has what it is about beside it
SILENT = 60


OF_ARGUMENTS = ("InputError", "TaskError", "UnknownNameError", "UrdfError")


@functools.cache
def raising():
    """All errors of arguments that the package makes: the place, the message and the names of the attributes."""
    found, making = [], re.compile(rf"\b({'|'.join(OF_ARGUMENTS)})\(")
    for file in sorted(Path(pc.__file__).parent.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if making.search(text) else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in OF_ARGUMENTS and node.args:
                beside = {keyword.arg for keyword in node.keywords}
                found.append((f"{file.name}:{node.lineno}", node.func.id, said(node.args[0]), beside))
    return found


def said(message):
    """Return a text of the source, with its expressions in braces."""
    if isinstance(message, ast.JoinedStr):
        parts = [ast.unparse(one.value) if isinstance(one, ast.FormattedValue) else one for one in message.values]
        return "".join(f"{{{one}}}" if isinstance(one, str) else one.value for one in parts)
    return getattr(message, "value", "")


def test_most_errors_have_attributes():
    """The errors of arguments that are raised with a message alone are counted, and do not become more."""
    silent = [place for place, kind, _, beside in raising() if kind in ("InputError", "TaskError") and not beside]
    assert len(silent) <= SILENT, silent


def test_a_message_that_begins_with_an_argument_has_it_beside():
    """Where a message is ``name = value, expected …`` or ``name has shape …``, both are attributes."""
    begin = re.compile(r"(\w+|\{\w+\})( = | ha(s|ve) shape )")
    named = [(place, beside) for place, _, message, beside in raising() if begin.match(message)]
    assert len(named) > 100
    assert [place for place, beside in named if None not in beside and not {"argument", "value"} <= beside] == []


def test_all_is_none_where_an_error_is_not_about_it():
    error = errors.InputError("a sentence")
    for name in ("argument", "value", "limit", "choices", "joint", "s", "time", "file", "line"):
        assert getattr(error, name) is None


@pytest.mark.parametrize(
    "error",
    [
        errors.ToolpathError("a", line=3, file="b.ngc"),
        errors.SimulationError("a", None, time=1.5),
        errors.MissingExtraError("pymoo", "tune", "tuning"),
        errors.TaskError("a", joint="elbow", value=1.0, limit=(0.0, 0.5), s=0.25),
        errors.StorageError("a", 28, file="b"),
    ],
)
def test_details_travel_with_errors_between_processes(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_what_cannot_be_pickled_is_left_behind():
    """A task of a user's functions stays where it is; the rest of the error arrives."""
    error = errors.InputError("a", argument="path", value=lambda s: s)
    assert vars(pickle.loads(pickle.dumps(error))) == {"argument": "path"}
    assert pickle.loads(pickle.dumps(errors.StorageError("a", 28))).errno == 28


def test_details_are_plain_values():
    """Numbers and arrays of NumPy become those of Python, also in the two ends of a range."""
    error = errors.InputError("a", value=np.float64(1.5), limit=(np.float64(0.0), np.array([1, 2])), s=np.arange(2.0))
    assert (error.value, error.limit, error.s) == (1.5, (0.0, [1, 2]), [0.0, 1.0])
    assert {type(error.value), type(error.limit[0])} == {float}


def test_a_diverged_run_says_when(arm, circle):
    law = pc.Projection(arm, circle, 1e7, 1e7)
    error = raised(
        pc.SimulationError, lambda: pc.simulate(law, [1.0, 0.1], duration=5.0, loop=pc.SampledLoop(), progress=False)
    )
    assert 0 < error.time <= 5.0
    assert (error.run.status == "diverged").all()


def test_details_that_are_added_by_the_place_are_plain_too():
    with pytest.raises(pc.InputError) as caught, errors.about(value=np.array([1.0, 2.0]), joint="joint_1"):
        raise pc.InputError("too much")
    assert (caught.value.value, caught.value.joint) == ([1.0, 2.0], "joint_1")
    assert type(caught.value.value) is list
