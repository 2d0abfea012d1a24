"""The files of runs: netCDF or MCAP, by the name when written and by the content when read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pathcontrol._files import as_path
from pathcontrol._suffixes import check_suffix
from pathcontrol.simulation.context import StoredContext
from pathcontrol.simulation.samples import Samples
from pathcontrol.simulation.storage.mcap_records import MAGIC

if TYPE_CHECKING:
    import xarray as xr


def write_file(path: str | Path, data: xr.Dataset | Samples, config: Mapping[str, Any], stored: StoredContext) -> Path:
    """Write a run, whole or not at all; return its path.

    Raises:
        InputError: the name ends with neither ``.nc`` nor ``.mcap``.
        StorageError: the file cannot be written.
    """
    path = check_suffix(path, "a run", ".nc", ".mcap")
    if path.suffix.lower() == ".mcap":
        from pathcontrol.simulation.storage.mcap_run import write_mcap  # loads h5py, for the checks of what is read

        write_mcap(path, data, config, stored)
    else:
        from pathcontrol.simulation.storage.netcdf import write_run  # loads HDF5

        write_run(path, data, config, stored)
    return path


def read_file(path: str | Path) -> tuple[xr.Dataset | Samples, dict[str, Any], StoredContext | None]:
    """Read data, configuration, and robot and path if the file has them.

    Raises:
        InputError: there is no such file, it is damaged, or it is not a saved run.
    """
    path = as_path("path", path)
    if _begins_as_mcap(path) or (path.suffix.lower() == ".mcap" and path.is_file()):
        from pathcontrol.simulation.storage.mcap_run import read_mcap

        return read_mcap(path)
    from pathcontrol.simulation.storage.netcdf import read_run

    return read_run(path)


def _begins_as_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP files do."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC
