"""A machine on this computer, in a process of its own."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_whole
from pathcontrol._expect import expect
from pathcontrol.errors import ArmError
from pathcontrol.hardware.sil.machine import MachineSettings, load_mujoco
from pathcontrol.hardware.sil.mjcf import friction_bias, write_mjcf
from pathcontrol.hardware.sil.packets import check_key
from pathcontrol.robot.model import RobotModel

_STEP = 2e-4  # s, longest step of MuJoCo


class MachineProcess:
    """A machine on this computer, in a process of its own.

    Args:
        robot: the arm, with its friction.
        q: where it starts [rad], (n,).
        period: time between its states [s].
        host: address at which it listens; one that is not of this computer needs a ``key``.
        port: its port, 0 for a free one.
        key: the shared key; a random one by default.

    Raises:
        InputError: the address is not of this computer and there is no key.
        MissingExtraError: MuJoCo is not installed.
        ArmError: the process does not start.
    """

    def __init__(
        self,
        robot: RobotModel,
        q: Array,
        period: float = 1e-3,
        host: str = "127.0.0.1",
        port: int = 0,
        key: bytes | None = None,
    ) -> None:
        expect("robot", robot, RobotModel)
        load_mujoco()
        self.key = secrets.token_bytes(32) if key is None else key
        check_key(host, key)
        as_whole("port", port, 0, 65535)
        settings = choose_settings(robot, q, period, host, port, self.key)
        command = [sys.executable, "-m", "pathcontrol.hardware.sil.machine"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=_with_package()
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):  # a process that ends at once says why by itself
            self._process.stdin.write(json.dumps(settings._asdict()) + "\n")
            self._process.stdin.flush()
        said = self._process.stdout.readline().strip()
        if not said.isdigit():
            self.kill()
            reason = said or "its reason is above"
            raise ArmError(
                f"the machine at {host}:{port} did not start: {reason}; port 0 takes a free one",
                argument="port",
                value=port,
            )
        self.port = int(said)

    @property
    def running(self) -> bool:
        """True while the machine has not ended."""
        return self._process.poll() is None

    def kill(self) -> None:
        """End the process, if it still runs."""
        self._process.kill()
        self._process.wait()

    def wait(self, longest: float = 10.0) -> dict[str, Any]:
        """Return what the machine counted, when it has ended; one that does not end within a time [s] is killed."""
        try:
            said, _ = self._process.communicate(timeout=longest)
        except subprocess.TimeoutExpired:
            self._process.kill()
            said, _ = self._process.communicate()
        lines = said.strip().splitlines()
        return dict(json.loads(lines[-1])) if lines else {}


def choose_settings(robot: RobotModel, q: Array, period: float, host: str, port: int, key: bytes) -> MachineSettings:
    """Return the settings of a machine that is the ``robot`` at rest at q [rad], (n,)."""
    steps = max(1, int(np.ceil(period / _STEP - 1e-9)))
    effort = np.where(robot.limits.effort > 0, robot.limits.effort, np.inf)
    return MachineSettings(
        write_mjcf(robot, period / steps),
        steps,
        friction_bias(robot).tolist(),
        np.minimum(effort, 1e9).tolist(),
        np.asarray(q, dtype=np.float64).tolist(),
        period,
        host,
        port,
        key.hex(),
    )


def _with_package() -> dict[str, str]:
    """Return the environment in which a process finds this package where this process has found it.

    The machine draws nothing: what MuJoCo draws with takes a quarter of the time to load.
    """
    folders = filter(None, [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "MUJOCO_GL": "disable", "PYTHONPATH": os.pathsep.join(folders)}
