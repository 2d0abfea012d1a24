"""A simulated Franka in a process of its own, with the MuJoCo that franka-sim asks for in a folder beside ours."""

import fcntl
import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

ROTORS = [0.2, 0.2, 0.2, 0.2, 0.07, 0.07, 0.07]  # kg m², which the URDF lacks: without them wrists weigh 0.1 g m²
STRICT = ["--enforce-motion-limits", "--enforce-comm-constraints"]
NEEDS = ["mujoco>=3.2,<3.3", "franka-sim==1.1.7"]  # with NumPy all that is imported where nothing is drawn
UNDRAWN = {"MUJOCO_GL": "disable"}


@contextmanager
def locked(path):
    """Only one process of this computer at a time."""
    with open(path, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def install(folder):
    """The folder with franka-sim, filled once for all processes of the tests; skips without."""
    with locked(f"{folder}.lock"):
        if not (folder / "done").exists():
            pip = [sys.executable, "-m", "pip", "install", "-q", "--only-binary=:all:", "--target", folder]
            pip += ["--no-compile", "--no-deps"]  # most of what is installed is never imported; any NumPy will do
            done = subprocess.run([*pip, *NEEDS], capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"franka-sim cannot be installed here: {done.stderr.strip().splitlines()[-1]}")
            (folder / "done").touch()
    return folder


def urdf_of(folder):
    """The URDF that franka-sim serves to its clients."""
    return folder / "franka_sim" / "models" / "fr3.urdf"


@contextmanager
def serve(folder, enforced=STRICT):
    """Serve a robot at its home posture on libfranka's port, of which there is one; yields the process.

    It stops by itself at the limits that are ``enforced``.
    """
    script = Path(__file__).with_name("franka_simulator.py")
    command = [sys.executable, script, "--no-gripper", *enforced, ",".join(map(str, ROTORS))]
    environment = os.environ | UNDRAWN | {"PYTHONPATH": str(folder)}
    port = Path(tempfile.gettempdir()) / "franka-1337.lock"
    with locked(port), tempfile.NamedTemporaryFile("w") as log:
        server = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
        try:
            wait_for(server, log)
            yield server
        finally:
            server.kill()
            server.wait()


def wait_for(server, log):
    """Wait until the server listens."""
    for _ in range(600):
        text = Path(log.name).read_text()
        if "ready for new client" in text:
            return
        if server.poll() is not None:
            break
        time.sleep(0.1)
    raise RuntimeError(text)
