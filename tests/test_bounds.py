"""What is too large is refused at once, by the key that says it, before anything is read, allocated or computed."""

from __future__ import annotations

import multiprocessing
import os
import resource
from pathlib import Path

import pytest
from patience import PATIENCE

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.load import load_experiment
from pathcontrol.experiments.runner import load_setup

GOOD = """
duration = 1.0
[robot]
source = "cicese_2dof"
[task]
type = "lissajous"
amplitudes = [0.3, 0.2]
frequencies = [1, 2]
speed = 1.0
[controller]
type = "projection"
k_p = 800.0
K_v = [45.0, 100.0]
"""


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "experiment.toml"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


def refusal(file: Path) -> str:
    with pytest.raises(ExperimentError) as error:
        load_setup(file)
    assert len(str(error.value)) < 6000
    return str(error.value)


def test_the_experiment_that_is_spoilt_below_is_a_good_one(tmp_path):
    load_setup(write(tmp_path, GOOD))


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/urandom"])
def test_a_device_is_no_experiment(path):
    assert "device, expected a file" in refusal(Path(path))


def test_a_pipe_is_no_experiment(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")  # which nobody writes to: reading it would wait for ever
    assert "a pipe" in refusal(tmp_path / "pipe.toml")


def test_a_folder_is_no_experiment(tmp_path):
    assert "a folder, expected a file" in refusal(tmp_path)


def test_a_file_of_20_gigabytes_is_not_read(tmp_path):
    file = write(tmp_path, GOOD)
    os.truncate(file, 20_000_000_000)  # a sparse file takes no room
    assert "longer than 2 MB" in refusal(file)


def test_a_file_that_is_not_utf_8_is_told_by_its_line(tmp_path):
    file = write(tmp_path, GOOD.encode() + b"# caf\xe9\n")
    assert f"line {GOOD.count(chr(10)) + 1} has the byte 0xe9, expected text in UTF-8" in refusal(file)


def test_a_file_with_a_byte_order_mark_and_line_ends_of_windows_is_read(tmp_path):
    load_setup(write(tmp_path, b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode()))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("duration = 1.0", "duration = 1e300", ["duration = 1e+300", "samples", "shorten"]),
        ("duration = 1.0", "duration = 1.0\nloop.period = 1e-300", ["loop.period = 1e-300", "samples", "lengthen"]),
        ("duration = 1.0", "duration = 1e300\nloop.period = 1e-300", ["samples"]),
        ("duration = 1.0", "duration = 1.0\nloop.substeps = 1000000000000", ["loop.substeps = 1000000000000", "10000"]),
        ("duration = 1.0", "duration = 1.0\nloop.delay = 1e300", ["loop.delay = 1e+300", "at most"]),
        (
            "duration = 1.0",
            'duration = 1.0\nloop.mode = "continuous"\nloop.output_period = 1e-300',
            ["loop.output_period = 1e-300", "samples"],
        ),
        ("[1, 2]", "[1000000000, 1000000001]", ["task.frequencies = [1000000000", "up to 1000"]),
        ("[1, 2]", f"[1, {'9' * 400}]", ["task.frequencies = [1, 999", "expected a list of whole numbers"]),
        ("duration = 1.0", f"duration = {'9' * 400}", ["duration = 999", "expected a number greater than 0"]),
        ("duration = 1.0", f"duration = {'9' * 5000}", ["TOML"]),
        ("duration = 1.0", f"duration = 1.0\nlaps = {'9' * 400}", ["laps = 999", "expected a whole number"]),
        ("k_p = 800.0", f"k_p = {'9' * 400}", ["controller.k_p = 999", "expected a finite number"]),
        ("duration = 1.0", "a = " + "[" * 100_000, ["TOML"]),
        ("duration = 1.0", "a" + ".a" * 100_000 + " = 1", ["line 2 has a key of more than 100 parts"]),
        ("duration = 1.0", "\n".join(f"a{i} = 1" for i in range(50_000)), ["a0: unknown key", "and more"]),
        ("duration = 1.0", "a" * 1_000_000 + " = 1", ["unknown key"]),
        ("[0.3, 0.2]", '["1 x"' + ', "1 x"' * 50_000 + "]", ["task.amplitudes[0] = '1 x'", "and more"]),
    ],
)
def test_numbers_beyond_all_bounds_are_refused_by_their_key(tmp_path, old, new, words):
    message = refusal(write(tmp_path, GOOD.replace(old, new, 1)))
    assert all(word in message for word in words), message


@pytest.mark.parametrize("line", ["duration = 1e300", "duration = 1.0\nloop.period = 1e-300"])
def test_refusing_takes_no_memory(tmp_path, capfd, line):
    """In a process that may have 3 GB more than this one: what is allocated first would end it."""
    file = write(tmp_path, GOOD.replace("duration = 1.0", line))
    pages = int(Path("/proc/self/statm").read_text().split()[0])

    def child():
        most = pages * resource.getpagesize() + (3 << 30)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        main(["run", str(file), "--out", str(tmp_path / "out")], standalone_mode=False)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    process.join(PATIENCE)
    error = capfd.readouterr().err
    assert process.exitcode == 2, error
    assert error.startswith("error: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "loop", "words"),
    [
        ({"duration": 1e300}, pc.SampledLoop(), ["duration = 1e+300 s", "GB", "shorten duration"]),
        ({"duration": 1.0}, pc.SampledLoop(period=1e-300), ["period = 1e-300 s", "samples", "lengthen period"]),
        ({"duration": 1e300, "laps": 1}, pc.SampledLoop(), ["duration"]),
        ({"duration": 1e300, "laps": 1}, pc.ContinuousTime(), ["output_period"]),
        ({"duration": 1.0}, pc.SampledLoop(delay=1e12), ["delay = 1e+12 s", "at most"]),
    ],
)
def test_a_run_that_does_not_fit_into_memory_is_not_begun(arm, options, loop, words):
    law = pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, 50.0)
    with pytest.raises(pc.InputError) as error:
        pc.simulate(law, [1.0, 0.0], loop=loop, **options)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_run_that_ends_by_itself_may_be_given_more_time_than_fits(arm):
    law = pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, 50.0)
    run = pc.simulate(law, [1.0, 0.0], duration=1e9, laps=1)
    assert run.status[0] == "finished"


@pytest.mark.parametrize("count", [10**18, 0, -1, 1.5])
def test_substeps_are_counted_in_thousands_at_most(count):
    with pytest.raises(pc.InputError, match="substeps"):
        pc.SampledLoop(substeps=count)


def test_an_experiment_that_is_only_read_is_refused_too(tmp_path):
    with pytest.raises(ExperimentError, match="line"):
        load_experiment(write(tmp_path, GOOD + "speed = = 1"))
