"""The commonest slips: arguments of the wrong kind, swapped, or gains as the paper writes them."""

from __future__ import annotations

import importlib.metadata
import inspect
from pathlib import Path

import numpy as np
import pytest

import pathcontrol as pc


@pytest.fixture(scope="module")
def things():
    """One of each kind of thing that calls of the package pass around."""
    arm = pc.load_robot("cicese_2dof")
    task = pc.Circle(1.0, 2.0)
    controller = pc.Projection(arm, task, 800.0, 50.0)
    run = pc.simulate(controller, [1.0, 0.0], duration=0.05)
    return {
        "name": "cicese_2dof",
        "path": Path("some") / "file",
        "robot": arm,
        "task": task,
        "class": pc.Circle,
        "controller": controller,
        "run": run,
        "figure": pc.error_figure(run),
        "loop": pc.SampledLoop(),
        "number": 1.0,
        "none": None,
        "list": [1.0, 2.0],
        "text": "x",
    }


#: the first words of what is refused, by the names of arguments, where every function takes the same kind
KINDS = {
    "robot": {"robot"},
    "task": {"task"},
    "controller": {"controller"},
    "run": {"run"},
    "figure": {"figure"},
    "toolpath": set(),
    "animation": set(),
    "runs": {"run"},
    "sweep": set(),
    "space": set(),
}
#: checked only after what the run is about
LATER = ("deviation_figure-robot", "tool_deviation-robot", "toolpath_metrics-robot")
REST = {
    "frame": "tool",
    "curve": [[0.5, 0.0, 0.0]],
    **dict.fromkeys(["K_p", "K_v", "k_p", "k", "Lambda", "K_d", "speed", "s"], 1.0),
    "q": [0.0, 0.0],
    "qd": [0.0, 0.0],
    "n": 2,
    "step": 0.01,
    "force": [0.0, 0.0, 1.0],
    "duration": 0.1,
    "path": "out",
    "out": "out.html",
    **dict.fromkeys(["x", "y", "parameter"], "a"),
    "build": dict,
    "objectives": "e_p_peak",
}  # fmt: skip


def _calls():
    """Every public function or class with an argument of a known kind, and that argument."""
    for name in pc.__all__:
        made = getattr(pc, name)
        if (
            name in ("RobotModel", "Run", "Controller", "MotionController")
            or inspect.isabstract(made)
            or not callable(made)
        ):
            continue  # made by other calls, or by subclasses
        try:
            parameters = inspect.signature(made).parameters
        except ValueError:  # errors
            continue
        ids = [f"{name}-{argument}" for argument in parameters if argument in KINDS]
        yield from (pytest.param(*one.split("-"), id=one) for one in ids if one not in LATER)


@pytest.mark.parametrize(("name", "argument"), list(_calls()))
def test_what_is_of_the_wrong_kind_is_refused_by_its_name(things, tmp_path, monkeypatch, name, argument):
    monkeypatch.chdir(tmp_path)
    made = getattr(pc, name)
    parameters = inspect.signature(made).parameters
    needed = {key for key, p in parameters.items() if p.default is p.empty and p.kind is not p.VAR_KEYWORD}
    right = {"robot": "robot", "task": "task", "controller": "controller", "run": "run", "figure": "figure"}
    for kind, value in things.items():
        if kind in KINDS[argument] or (value is None and parameters[argument].default is None):
            continue
        given = {key: things[right[key]] for key in needed & set(right)}
        given |= {key: REST[key] for key in needed & set(REST)} | {argument: value}
        if needed - set(given):
            pytest.skip(f"needs {needed - set(given)}")
        with pytest.raises(pc.PathControlError) as error:
            made(**given)
        words = str(error.value)
        assert argument in words, (kind, words)
        assert "\n" not in words
        assert len(words) < 400, words


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda t: pc.Projection("cicese_2dof", t["task"], 1.0, 1.0),
            ["robot", "'cicese_2dof'", "load_robot('cicese_2dof')"],
        ),
        (lambda t: pc.Projection(t["path"], t["task"], 1.0, 1.0), ["some/file", "load_robot('some/file')"]),
        (lambda t: pc.Projection(t["task"], t["robot"], 1.0, 1.0), ["robot is a Circle", "PathTask", "swapped"]),
        (lambda t: pc.Projection(t["robot"], pc.Circle, 1.0, 1.0), ["the class Circle", "Circle(…)"]),
        (
            lambda t: pc.simulate(t["task"], [0.0, 0.0], duration=1.0),
            ["controller is a Circle", "Projection(robot, task"],
        ),
        (
            lambda t: pc.simulate(t["robot"], [0.0, 0.0], duration=1.0),
            ["controller is a RobotModel", "Projection(robot"],
        ),
        (
            lambda t: pc.simulate_sequence([t["task"]], [0.0, 0.0], duration=1.0),
            ["controllers[0] is a Circle", "Projection"],
        ),
        (lambda t: pc.save_figure(t["run"], "x"), ["figure is a Run", "path_figure(run)"]),
        (lambda t: pc.save_figure("x", t["figure"]), ["figure = 'x'", "path_figure(run)"]),
        (lambda t: pc.metrics(t["task"], t["run"]), ["run is a Circle", "simulate(controller", "swapped"]),
        (lambda t: pc.metrics("run.nc"), ["run = 'run.nc'", "Run.load('run.nc')"]),
        (lambda t: pc.metrics(t["run"], t["controller"]), ["task is a Projection", "controller.task"]),
        (lambda t: pc.path_figure(t["run"], t["robot"]), ["task is a RobotModel", "Circle("]),
        (lambda t: pc.record(t["controller"]), ["run is a Projection", "simulate(controller"]),
        (
            lambda t: pc.ToolpathTask(t["robot"], "tool", "part.svg"),
            ["toolpath = 'part.svg'", "read_toolpath('part.svg')"],
        ),
        (lambda t: pc.save_video(t["run"], "x.mp4"), ["animation is a Run", "record(run)"]),
        (lambda t: pc.TaskBatch([t["robot"]]), ["tasks[0] is a RobotModel", "PathTask"]),
        (lambda t: pc.RobotBatch(["ur5"]), ["robots[0] = 'ur5'", "load_robot('ur5')"]),
        (lambda t: pc.time_optimal(t["task"], t["robot"]), ["robot is a Circle", "swapped"]),
        (lambda t: pc.limited(t["task"], t["robot"]), ["limits[0] is a RobotModel", "MotionLimit("]),
        (lambda t: pc.check_task(t["robot"], 2), ["task is a RobotModel"]),
    ],
)
def test_a_slip_is_told_with_what_to_call(things, call, words):
    with pytest.raises(pc.PathControlError) as error:
        call(things)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_the_version_is_that_of_the_installed_package():
    assert pc.__version__ == importlib.metadata.version("pathcontrol")


def test_a_public_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such"):
        _ = pc.no_such


@pytest.mark.parametrize("law", [pc.ComputedTorque, pc.PDPlus, pc.SlotineLi])
def test_a_diagonal_matrix_is_its_diagonal(arm, law):
    task = pc.Circle(1.0, 2.0)
    matrix = law(arm, task, np.diag([800.0, 600.0]), np.diag([45.0, 100.0]).tolist())
    diagonal = law(arm, task, [800.0, 600.0], [45.0, 100.0])
    for gain in law.gains:
        np.testing.assert_array_equal(getattr(matrix, gain), getattr(diagonal, gain))


def test_gains_of_the_path_controllers_as_the_paper_writes_them(arm):
    task, q, qd = pc.Circle(1.0, 2.0), np.array([0.5, 0.2]), np.array([0.3, -0.4])
    pairs = [
        (
            pc.ExtendedMotionPlan(arm, task, np.diag([800.0, 600.0]), np.diag([45.0, 100.0]), 20.0),
            pc.ExtendedMotionPlan(arm, task, [800.0, 600.0], [45.0, 100.0], 20.0),
        ),
        (
            pc.Projection(arm, task, 800.0 * np.eye(2), np.diag([45.0, 100.0])),
            pc.Projection(arm, task, 800.0, [45.0, 100.0]),
        ),
    ]
    for matrix, numbers in pairs:
        tau = [law.law(0.0, q, qd, law.start(q, qd)).tau for law in (matrix, numbers)]
        np.testing.assert_array_equal(*tau)


@pytest.mark.parametrize(
    "matrix",
    [
        [[800.0, 10.0], [10.0, 600.0]],
        [[800.0, 10.0], [0.0, 600.0]],
        [[800.0, -300.0], [-300.0, 600.0]],
        [[0.0, 800.0], [600.0, 0.0]],
    ],
)
def test_a_matrix_that_is_not_diagonal_is_refused_with_the_reason(arm, matrix):
    task = pc.Circle(1.0, 2.0)
    for make in (
        lambda: pc.ExtendedMotionPlan(arm, task, matrix, 1.0, 1.0),
        lambda: pc.ComputedTorque(arm, task, 1.0, matrix),
        lambda: pc.Projection(arm, task, 1.0, matrix),
        lambda: pc.Projection(arm, task, matrix, 1.0),
    ):
        with pytest.raises(pc.InputError, match=r"not diagonal.*theorem"):
            make()


def test_a_matrix_of_two_gains_is_none_for_the_projection_law(arm):
    with pytest.raises(pc.InputError, match=r"k_p.*expected a scalar"):
        pc.Projection(arm, pc.Circle(1.0, 2.0), np.diag([800.0, 600.0]), 1.0)


def test_a_diagonal_matrix_with_a_gain_that_is_not_positive_is_refused(arm):
    with pytest.raises(pc.InputError, match="greater than 0"):
        pc.ComputedTorque(arm, pc.Circle(1.0, 2.0), np.diag([800.0, 0.0]), 1.0)


@pytest.mark.parametrize("rows", [[[800.0, 700.0], [600.0, 500.0]], [[800.0, 800.0], [800.0, 900.0]]])
def test_rows_of_gains_for_as_many_rollouts_as_joints_stay_rows(arm, rows):
    law = pc.ComputedTorque(arm, pc.Circle(1.0, 2.0), rows, 1.0)
    np.testing.assert_array_equal(law.K_p, rows)


def test_rows_of_gains_that_look_like_a_matrix_are_given_with_an_axis_more(arm):
    rows = np.array([[800.0, 5.0], [5.0, 800.0]])
    law = pc.ComputedTorque(arm, pc.Circle(1.0, 2.0), rows[:, None], 1.0)
    np.testing.assert_array_equal(law.K_p, rows)
    run = pc.simulate(law, [1.0, 0.0], duration=0.01)
    assert run.rollouts == 2


def test_a_gain_of_an_experiment_may_be_a_diagonal_matrix(tmp_path):
    from pathcontrol.experiments.runner import load_setup
    from pathcontrol.experiments.template import example_text

    file, text = tmp_path / "experiment.toml", example_text()
    assert "\nK_p = 800.0" in text
    file.write_text(text.replace("\nK_p = 800.0", "\nK_p = [[800.0, 0.0], [0.0, 700.0]]"), encoding="utf-8")
    np.testing.assert_array_equal(load_setup(file).controller.K_p, [800.0, 700.0])
    file.write_text(text.replace("\nK_p = 800.0", "\nK_p = [[800.0, 1.0], [0.0, 700.0]]"), encoding="utf-8")
    with pytest.raises(pc.ExperimentError, match=r"controller\.K_p = .* not diagonal"):
        load_setup(file)


@pytest.mark.parametrize("number", ["a", None, [0], 0.5, True, float("nan")])
def test_rollouts_and_paths_are_whole_numbers(things, number):
    for take, name in (
        (things["run"].rollout, "rollout"),
        (lambda index: pc.lap_errors(things["run"], rollout=index), "rollout"),
        (things["run"].path, "path"),
    ):
        with pytest.raises(pc.PathControlError, match=rf"^{name} = .*, expected a whole number"):
            take(number)
