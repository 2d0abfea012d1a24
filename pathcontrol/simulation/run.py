"""The one result type: labelled arrays with their units and the full configuration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array
from pathcontrol._files import whole_file
from pathcontrol.errors import InputError

#: every variable of a run: (dimensions, unit, meaning); sliding joints have m for rad and N for N m
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "q": (("rollout", "time", "joint"), "rad", "joint position"),
    "qd": (("rollout", "time", "joint"), "rad/s", "joint velocity"),
    "q_measured": (("rollout", "time", "joint"), "rad", "joint position as the controller sees it"),
    "qd_measured": (("rollout", "time", "joint"), "rad/s", "joint velocity as the controller sees it"),
    "tau_demand": (("rollout", "time", "joint"), "N m", "torque the control law asks for"),
    "tau": (("rollout", "time", "joint"), "N m", "torque that acts from this moment on"),
    "s": (("rollout", "time"), "1", "path parameter"),
    "sdot": (("rollout", "time"), "1/s", "rate of the path parameter"),
    "e_p": (("rollout", "time", "joint"), "rad", "position error q_d(s) - q as the controller sees it"),
    "e_v": (
        ("rollout", "time", "joint"),
        "rad/s",
        "velocity error q_d'(s) theta(s) - qd as the controller sees it",
    ),
    "regular": (("rollout", "time"), "1", "0 where the path parameter was undefined and the last one kept"),
}
_CONFIG = "pathcontrol_config"


class Run:
    """What happened in a simulation, one or many rollouts.

    Attributes:
        data: an ``xarray.Dataset`` with the dimensions rollout, time and joint; see :data:`VARIABLES`.
        config: everything the run was made with: robot, task, controller, plant, loop, versions.
    """

    def __init__(self, data: xr.Dataset, config: Mapping[str, Any]) -> None:
        self.data, self.config = data, dict(config)

    @classmethod
    def from_arrays(
        cls, time: Array, joints: Mapping[str, str], arrays: Mapping[str, Array], config: Mapping[str, Any]
    ) -> Run:
        """A run from arrays laid out as :data:`VARIABLES` says, and the position unit of each joint by its name."""
        kinds = sorted(set(joints.values()), reverse=True)
        variables = {}
        for name, array in arrays.items():
            dims, unit, meaning = VARIABLES[name]
            units = {unit if kind == "rad" else unit.replace("rad", "m").replace("N m", "N"): None for kind in kinds}
            variables[name] = (dims, array, {"units": " or ".join(units), "long_name": meaning})
        rollouts = len(arrays["q"])
        coords = {
            "rollout": np.arange(rollouts),
            "time": ("time", time, {"units": "s"}),
            "joint": list(joints),
        }
        return cls(xr.Dataset(variables, coords), config)

    def __getitem__(self, name: str) -> xr.DataArray:
        """One variable by its name."""
        return self.data[name]

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name}: {size}" for name, size in self.data.sizes.items())
        return f"Run({self.config.get('controller', {}).get('controller', '?')}; {sizes})"

    @property
    def time(self) -> Array:
        """Time [s], (time,)."""
        return self.data["time"].to_numpy()

    @property
    def rollouts(self) -> int:
        """Number of rollouts."""
        return self.data.sizes["rollout"]

    def array(self, name: str) -> Array:
        """One variable as a plain array, (rollout, time, …)."""
        return self.data[name].to_numpy()

    def norm(self, name: str) -> Array:
        """Euclidean norm over the joints, (rollout, time), as ‖e_p‖ of ``run.norm("e_p")``."""
        return np.linalg.norm(self.array(name), axis=-1)

    def rollout(self, index: int) -> Run:
        """One of the rollouts as a run of its own."""
        if not -self.rollouts <= index < self.rollouts:
            raise InputError(f"rollout {index} does not exist: the run has {self.rollouts}, counted from 0")
        return Run(self.data.isel(rollout=[index]), self.config)

    def save(self, path: str | Path) -> Path:
        """Write netCDF, whole or not at all; :meth:`load` reads it back."""
        path = Path(path)
        data = self.data.assign_attrs({_CONFIG: json.dumps(self.config)})
        packed = {name: {"zlib": True, "complevel": 1} for name in data.data_vars}
        with whole_file(path) as temporary:
            data.to_netcdf(temporary, engine="h5netcdf", encoding=packed)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read what :meth:`save` wrote.

        Raises:
            InputError: there is no such file, or it is not a saved run.
        """
        path = Path(path)
        if not path.is_file():
            raise InputError(f"there is no file {str(path)!r}")
        try:
            data = xr.load_dataset(path, engine="h5netcdf")
            config = json.loads(data.attrs.pop(_CONFIG))
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f"{str(path)!r} is not a run saved by Run.save: {error}") from error
        return cls(data, config)
