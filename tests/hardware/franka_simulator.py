"""Serve a simulated Franka Research 3 by franka-sim, which is on the path of this process.

The model is that of the bundled URDF, with the rotor inertia of the joints added and without shapes. Three things are
changed, since this program shares two busy cores with its client, where a robot has a computer of its own: it has
real-time priority where that is allowed, its threads hand over to each other in less than a period, and its physics
takes one step for each state that it publishes, rather than by another clock, so that a state is as old as it says.
"""

import os
import re
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import franka_sim
import mujoco
from franka_sim import run_server
from franka_sim.franka_sim_server import FrankaSimServer
from franka_sim.mujoco_franka_sim import MujocoFrankaSim

URDF = Path(franka_sim.__file__).parent / "models" / "fr3.urdf"


def write_model(path, armature):
    """Write the MJCF of the bundled URDF, with a rotor inertia [kg m²] for each joint."""
    urdf = re.sub(r"<(visual|collision)\b.*?</\1>", "", URDF.read_text(), flags=re.DOTALL)
    options = '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco>'
    spec = mujoco.MjSpec.from_string(urdf.replace('<robot name="fr3">', f'<robot name="fr3">{options}'))
    for joint, inertia in zip(spec.joints, armature, strict=True):
        joint.armature = inertia
    spec.compile()
    Path(path).write_text(spec.to_xml())


def step_with_states():
    """Let the physics take one step for each published state."""
    account = FrankaSimServer._account_for_communication_cycle

    def account_and_step(server):
        account(server)
        server.physics_sim.step()

    def wait(simulator):
        while simulator.running:
            time.sleep(0.1)

    FrankaSimServer._account_for_communication_cycle = account_and_step
    MujocoFrankaSim.run_simulation = wait


if __name__ == "__main__":
    model = Path(tempfile.mkdtemp()) / "fr3.xml"
    write_model(model, [float(value) for value in sys.argv.pop().split(",")])
    os.environ["FR3_MJCF"] = str(model)
    sys.setswitchinterval(2e-4)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(70))
    step_with_states()
    run_server.main()
