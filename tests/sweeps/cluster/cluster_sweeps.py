"""The sweep that the tests of clusters make, what it leaves on disk, and an experiment with files beside it."""

from __future__ import annotations

import socket
import threading
import time

from scipy import stats

import pathcontrol as pc
from pathcontrol.experiments.load import read_toml
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
LOOP = pc.SampledLoop(encoders=True, velocity="difference")
# gains of 3e5 and more diverge with this period
SPACE = pc.Space.sobol(
    {"K_p": stats.loguniform(100.0, 3e6), "k": stats.uniform(1.0, 50.0), "q": stats.norm([0.7, 1.2], [0.3, 0.3])}, 16
)
PEAKS = ["e_p_peak", "tau_demand_peak"]
QUIET = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50}
KEEP = pc.Keep(worst=1, by="e_p_peak", random=1, diverged=1)


def circle(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], K_v=[45.0, 100.0], k=p["k"])
    return {"controller": law, "q": p["q"], "duration": 0.2, "loop": LOOP}


def swept(out, **changes):
    usual = {"build": circle, "space": SPACE, "metrics": PEAKS, "chunk": 2, "keep": KEEP, "progress": False}
    return pc.sweep(**usual | changes, out=out)


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def numbers(files):
    """Those files of a sweep that do not say which function built it."""
    return {name: value for name, value in files.items() if name != "manifest.json"}


def when_chunks_are_there(folder, count, action):
    def watch():
        while len(list(folder.glob("chunks/0*"))) < count:
            time.sleep(0.01)
        action()

    threading.Thread(target=watch, daemon=True).start()


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as unused:
        return unused.getsockname()[1]


TASK = """
import os
from pathlib import Path
import numpy as np
from pathcontrol import Circle

assert os.getpid() == {pid} or "{home}" not in __file__, "read where the user has it"
radius, rate = np.loadtxt(Path(__file__).parent / "tables/numbers.csv", delimiter=",")

class Mine(Circle):
    def __init__(self, table):
        more = float((Path(__file__).parent / table).read_text())
        super().__init__(radius + more, rate)
"""
FILE = """
duration = 0.1
[robot]
source = "../robots/arm.urdf"
[task]
type = "mine.py:Mine"
parameters = { table = "more.txt" }
[controller]
type = "projection"
K_v = [45.0, 100.0]
k_p = 800.0
[sweep]
keep = { worst = 1, by = "e_p_peak" }
[sweep.parameters]
"controller.k_p" = { grid = [500.0, 700.0, 900.0] }
"task.parameters.table" = { grid = ["more.txt", "even_more.txt"] }
"""


def swept_experiment(file):
    data = read_toml(file)
    return SweptExperiment(data, file.parent, data.pop("sweep")["parameters"])
