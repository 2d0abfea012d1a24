"""Other simulators stepped from Python, each where it is installed, with the plain law or ours.

All get the URDF that the arm came from, without its meshes, and one step per control period. Their friction is not
ours: MuJoCo's is a soft constraint, Drake and the robotics toolbox are stepped without dry friction.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import numpy as np

from benchmarks.cases import Case
from benchmarks.contest import Contender
from benchmarks.plain_loop import PlainLaw

#: the module that must be there for each peer
MODULES = {
    "MuJoCo": "mujoco",
    "mjbatch": "mjbatch",
    "Drake": "pydrake",
    "robotics-toolbox": "roboticstoolbox",
}
#: (q, q̇, τ) to the state one period later
Step = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def missing() -> list[str]:
    """Peers that are not installed."""
    return [name for name, module in MODULES.items() if find_spec(module) is None]


def single(case: Case, ticks: int) -> dict[str, Contender]:
    """The plain law on one arm of each peer that is installed."""
    steps = {"MuJoCo": mujoco_step, "Drake": drake_step, "robotics-toolbox": toolbox_step}
    # the toolbox is so slow that it gets few ticks
    lengths = {name: 10 if name == "robotics-toolbox" else ticks for name in steps}
    there = [name for name in steps if find_spec(MODULES[name])]
    return {name: _with_law(case, steps[name](case), lengths[name]) for name in there}


def batched(case: Case, rollouts: int, ticks: int, threads: int) -> dict[str, Contender]:
    """Our law, on all rollouts at once, on the arms of mjbatch."""
    if find_spec("mjbatch") is None:
        return {}
    import mjbatch

    law, (start_q, start_qd), period = case.law(threads), case.states(rollouts), case.loop.period
    batch = mjbatch.Batch(mujoco_model(case), rollouts, threads)
    q, qd, torque = batch.bind("qpos"), batch.bind("qvel"), batch.bind("qfrc_applied")
    effort, bias = case.robot.limits.effort, _bias(case)

    def run() -> None:
        q[:], qd[:] = start_q, start_qd
        z = law.start(start_q, start_qd)
        for _ in range(ticks):
            out = law.law(0.0, np.array(q), np.array(qd), z)
            torque[:] = np.minimum(np.maximum(out.tau, -effort), effort) - bias
            z = law.advance(z, out, period)
            batch.step()

    return {"mjbatch": Contender(run, rollouts, ticks)}


def _with_law(case: Case, step: Step, ticks: int) -> Contender:
    law, effort, rest = PlainLaw(case), case.robot.limits.effort, np.zeros(case.robot.n)
    first = float(case.law().start(case.start, rest)[0])

    def run() -> None:
        q, qd, s = case.start, rest, first
        for _ in range(ticks):
            tau, _, s, _, _ = law(s, q, qd)
            q, qd = step(q, qd, np.minimum(np.maximum(tau, -effort), effort))

    return Contender(run, 1, ticks)


def mujoco_model(case: Case) -> Any:
    """The arm in MuJoCo; its dry friction is the mean of the two directions."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(urdf(case))
    plus, minus = case.robot.friction.levels(np.zeros(case.robot.n))
    model.dof_damping, model.dof_frictionloss = case.robot.friction.viscous, 0.5 * (plus + minus)
    model.opt.timestep = case.loop.period
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


def mujoco_step(case: Case) -> Step:
    """One mj_step."""
    import mujoco

    model, bias = mujoco_model(case), _bias(case)
    data = mujoco.MjData(model)

    def step(q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        data.qpos, data.qvel, data.qfrc_applied = q, qd, tau - bias
        mujoco.mj_step(model, data)
        return data.qpos.copy(), data.qvel.copy()

    return step


def drake_step(case: Case) -> Step:
    """One discrete step of a MultibodyPlant."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.analysis import Simulator

    plant = MultibodyPlant(case.loop.period)
    Parser(plant).AddModelsFromString(urdf(case), "urdf")
    if (base := _base(case)) != "world":
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    port = plant.get_applied_generalized_force_input_port()

    def step(q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        port.FixValue(context, tau)
        plant.SetPositionsAndVelocities(context, np.concatenate([q, qd]))
        simulator.AdvanceTo(context.get_time() + case.loop.period)
        state = plant.GetPositionsAndVelocities(context)
        return state[: len(q)], state[len(q) :]

    return step


def toolbox_step(case: Case) -> Step:
    """Its forward dynamics and a step of Euler's method."""
    import roboticstoolbox

    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf(case), encoding="utf-8")
        robot = roboticstoolbox.Robot.URDF(str(path))

    def step(q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        after = qd + case.loop.period * np.asarray(robot.accel(q, qd, tau)).reshape(-1)
        return q + case.loop.period * after, after

    return step


def urdf(case: Case) -> str:
    """The URDF with what moves only: no meshes, no dry friction, and the joints fixed at 0 that the arm has not."""
    root = ElementTree.fromstring(case.robot.source.text)
    for link in root.findall("link"):
        _drop(link, "visual", "collision")
    for joint in root.findall("joint"):
        _drop(joint, "safety_controller")
        for dynamics in joint.findall("dynamics"):
            dynamics.set("friction", "0")
        if joint.get("type") != "fixed" and joint.get("name") not in case.robot.joint_names:
            joint.set("type", "fixed")
            _drop(joint, "axis", "limit", "dynamics", "mimic")
    return ElementTree.tostring(root, encoding="unicode")


def _drop(element: ElementTree.Element, *tags: str) -> None:
    for child in [child for child in element if child.tag in tags]:
        element.remove(child)


def _base(case: Case) -> str:
    """The link that is no joint's child."""
    root = ElementTree.fromstring(case.robot.source.text)
    children = {joint.find("child").get("link") for joint in root.findall("joint")}
    return next(link.get("name") for link in root.findall("link") if link.get("name") not in children)


def _bias(case: Case) -> np.ndarray:
    """Half the difference of the two levels: with their mean and this constant torque there are two levels again."""
    plus, minus = case.robot.friction.levels(np.zeros(case.robot.n))
    return 0.5 * (plus - minus)
