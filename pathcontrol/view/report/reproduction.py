"""The reproduction of a run: the experiment file it came from, or else Python that does the same."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pathcontrol.simulation.config import laws, table
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.summaries import is_whole
from pathcontrol.view.report.code import Name, call
from pathcontrol.view.report.disturbance_code import disturbance_code
from pathcontrol.view.report.downloads import Download, file_name, text_file
from pathcontrol.view.report.law_code import law_code
from pathcontrol.view.report.settings_table import Setting

_LOOPS = {"sampled": "SampledLoop", "continuous": "ContinuousTime"}


class Recipe(NamedTuple):
    """The recipe that makes one run again.

    Attributes:
        name: the run.
        kind: ``"experiment"``, ``"python"``, ``"log"`` of a real arm, or ``"none"`` where the run does not know enough.
        text: the experiment file or the script.
        file: it as a file.
    """

    name: str
    kind: str
    text: str = ""
    file: Download | None = None


def recipe(name: str, run: Run) -> Recipe:
    """Return the recipe of the run called ``name``."""
    experiment = run.config.get("experiment")
    if isinstance(experiment, str):
        return Recipe(name, "experiment", experiment, text_file(f"{file_name(name)}.toml", experiment))
    if table(run.config, "loop").get("loop") in ("log", "hardware"):
        return Recipe(name, "log")
    text = script(name, run)
    return Recipe(name, "python", text, text_file(f"{file_name(name)}.py", text)) if text else Recipe(name, "none")


def versions(configs: Sequence[Mapping[str, Any]]) -> list[Setting]:
    """Return the versions of the packages that each run was made with."""
    said = [table(config, "versions") for config in configs]
    names = dict.fromkeys(name for one in said for name in one)
    return [Setting(str(name), tuple(str(one.get(name, "–")) for one in said)) for name in names]


def script(name: str, run: Run) -> str:
    """Return Python that simulates a run again from its file, with the settings of its configuration.

    Empty where the configuration is not one that :func:`simulate` or :func:`simulate_sequence` has written.
    """
    loop, several = table(run.config, "loop"), laws(run.config)
    sequence = isinstance(run.config.get("duration"), list)
    law = law_code(several[0], "path" if sequence else "saved.task")
    if run.task is None or law is None or not _is_known(several, loop) or not _has_end(run.config, sequence):
        return ""
    outside = disturbance_code(run.config["disturbance"], run) if "disturbance" in run.config else None
    if (outside is None and "disturbance" in run.config) or table(run.config, "plant").get("arms", 1) != 1:
        return ""
    more = {} if run.model is run.robot else {"plant": Name("saved.robot")}
    if outside is not None:
        more["disturbance"] = Name("disturbance")
    settings = _without(loop, ["loop"])
    if "noise" in settings:
        settings["noise"] = Name(call("pc.SensorNoise", [], settings["noise"]))
    closed = call(f"pc.{_LOOPS[loop['loop']]}", [], settings)
    imports = [line for line in dict.fromkeys([*law.imports, *(outside.imports if outside else ())]) if line]
    lines = [
        "\n".join([*imports, "import pathcontrol as pc\n"]),
        f'saved = pc.Run.load("{file_name(name)}.nc")  # knows its robot, the model of its law and its path',
        f"loop = {closed}",
        'q, qd = saved.array("q")[:, 0], saved.array("qd")[:, 0]',
        *([] if outside is None else [f"disturbance = {outside.text}"]),
        *(_script_of_sequence if sequence else _script_of_one)(law.text, run.config, more),
    ]
    text = "\n".join(lines) + "\n"
    return f"from math import inf\n\n{text}" if re.search(r"\binf\b", text) else text


def _script_of_one(law: str, config: Mapping[str, Any], more: Mapping[str, Any]) -> list[str]:
    """Return the lines for a run along one path."""
    settings = {key: config[key] for key in ("duration", "laps", "until")} | {**more, "loop": Name("loop")}
    if config.get("first_rollout"):
        settings["first_rollout"] = config["first_rollout"]
    return [f"law = {law}", f"run = {call('pc.simulate', ['law', 'q', 'qd'], settings)}"]


def _script_of_sequence(law: str, config: Mapping[str, Any], more: Mapping[str, Any]) -> list[str]:
    """Return the lines for a run along a sequence of paths."""
    times = config["duration"]
    duration = times[0] if all(each == times[0] for each in times) else times
    settings = {
        "duration": duration,
        "laps": config["laps"],
        "task": Name("saved.task"),
        **more,
        "loop": Name("loop"),
    }
    run = call("pc.simulate_sequence", ["laws", "q", "qd"], settings)
    return [f"laws = [{law} for path in saved.task]", f"run = {run}"]


def _is_known(several: Sequence[Mapping[str, Any]], loop: Mapping[str, Any]) -> bool:
    """Return whether the laws are one with the same gains, and the loop is one of this package."""
    first = several[0]
    is_same_law = all(_without(law, ["robot", "task"]) == _without(first, ["robot", "task"]) for law in several)
    noise = loop.get("noise", {})
    if not isinstance(noise, Mapping):
        return False
    names = [*first, *loop, *noise]  # names of arguments from a file may be anything
    return (
        is_same_law
        and all(is_whole(_without(law, ["robot", "task"])) for law in several)
        and is_whole(loop)
        and loop.get("loop") in list(_LOOPS)
        and all(name.isidentifier() for name in names)
    )


def _has_end(config: Mapping[str, Any], sequence: bool) -> bool:
    """Return whether the configuration has the end of the simulation, of one path or of a sequence of them."""
    law, times = table(config, "controller"), config.get("duration")
    if sequence:  # one path of it, taken out, has no configuration of its own
        return "sequence" in law and bool(times) and "laps" in config
    return "sequence" not in law and isinstance(times, int | float) and {"laps", "until"} <= config.keys()


def _without(entries: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """Return entries without some keys."""
    return {key: value for key, value in entries.items() if key not in keys}
