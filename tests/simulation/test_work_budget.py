"""Continuous time that does not get on: a budget of work for a simulated second, and Ctrl-C."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from patience import PATIENCE

from pathcontrol.control.projection import Projection
from pathcontrol.errors import SimulationError
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation import continuous
from pathcontrol.simulation.arm.disturbance import Harmonic
from pathcontrol.simulation.loops import ContinuousTime
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle


def test_a_run_that_needs_too_much_work_for_a_simulated_second_ends_with_a_reason(monkeypatch):
    arm = load_robot("cicese_2dof").with_friction(None)
    law = Projection(arm, Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    start, shaken = law.task.q_d(np.zeros(())), Harmonic([50.0, 5.0], 2e4)
    monkeypatch.setattr(continuous, "_MOST_WORK", 1000)
    with pytest.raises(SimulationError, match=r"integrator crawls.*SampledLoop") as error:
        simulate(law, start, duration=1.0, loop=ContinuousTime(), disturbance=shaken, progress=False)
    assert 0 < float(error.value.run.diverged_time[0]) < 0.1
    # what is smooth takes less for each second, some 700, however many there are
    run = simulate(law, start, duration=2.0, loop=ContinuousTime(output_period=0.05), progress=False)
    assert str(run.status[0]) == "running"


LONG = """
import pathcontrol as pc
law = pc.Projection(pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
loop = pc.ContinuousTime()
pc.simulate(law, [0.7, 1.2], duration=0.01, loop=loop, progress=False)
try:
    print("integrating", flush=True)
    pc.simulate(law, [0.7, 1.2], duration=1e3, loop=loop, progress=False)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_interrupts_the_integrator():
    process = subprocess.Popen(
        [sys.executable, "-c", LONG],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "integrating\n"
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert (out, err, process.returncode) == ("interrupted\n", "", 0)
