"""Runs in MCAP files: bit-equal, readable by others, whole or told, whatever happens to the file."""

from __future__ import annotations

import io
import json
import warnings

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlError, PathControlWarning
from pathcontrol.simulation.storage.mcap_messages import MessageFormat, Variable

pytest.importorskip("mcap")
ROBOT = pc.load_robot("cicese_2dof")
LAW = pc.ExtendedMotionPlan(ROBOT, pc.Circle(0.5, 2.0), 800.0, K_v=[45.0, 100.0], k=20.0)


@pytest.fixture(scope="module")
def run():
    return pc.simulate(LAW, [[0.7, 1.2], [0.1, -0.0]], duration=0.2, progress=False)


def assert_same(one, other):
    """All variables and coordinates have the same bits, units and types; robot, path and configuration are the same."""
    xr.testing.assert_identical(one.data, other.data)
    for name in one.data.variables:
        a, b = one.data[name].to_numpy(), other.data[name].to_numpy()
        assert (a.dtype == b.dtype and a.tobytes() == b.tobytes()) or a.dtype.kind in "UO", name
    assert other.config == one.config
    assert repr(other.task) == repr(one.task)
    assert other.robot.name == one.robot.name
    q = np.array([0.3, 0.4])
    assert (other.robot.mass_matrix(q) == one.robot.mass_matrix(q)).all()


def test_a_run_comes_back_bit_equal(run, tmp_path):
    loaded = pc.Run.load(run.save(tmp_path / "run.mcap"))
    assert_same(run, loaded)
    assert repr(pc.metrics(loaded)) == repr(pc.metrics(run))


def test_a_run_that_goes_from_format_to_format_stays_the_same(run, tmp_path):
    first = pc.Run.load(run.save(tmp_path / "run.nc"))
    second = pc.Run.load(first.save(tmp_path / "run.mcap"))
    third = pc.Run.load(second.save(tmp_path / "again.nc"))
    assert_same(first, second)
    assert_same(second, third)


def test_rollouts_that_diverge_and_sequences_of_paths_are_kept(tmp_path):
    law = pc.ComputedTorque(ROBOT, pc.Circle(0.5, 2.0), 400.0, 40.0)
    push = pc.Push([[0.0, 0.0], [1e308, 0.0]], 0.05, 0.1)
    diverged = pc.simulate(law, [0.5, 0.0], duration=0.2, disturbance=push, progress=False)
    assert "diverged" in diverged.status
    assert_same(diverged, pc.Run.load(diverged.save(tmp_path / "diverged.mcap")))
    paths = [pc.Line([0.0, 0.0], [0.1, 0.1], 2.0), pc.Line([0.1, 0.1], [0.2, 0.1], 2.0)]
    laws = [pc.ComputedTorque(ROBOT.with_friction(pc.no_friction(2)), path, 400.0, 40.0) for path in paths]
    sequence = pc.simulate_sequence(
        laws, [0.0, 0.0], duration=1.0, task=pc.PathSequence(paths), plant=laws[0].robot, progress=False
    )
    loaded = pc.Run.load(sequence.save(tmp_path / "sequence.mcap"))
    assert_same(sequence, loaded)
    assert_same(sequence.path(1), pc.Run.load(sequence.path(1).save(tmp_path / "part.mcap")))


def test_numbers_of_any_kind_are_kept(run, tmp_path):
    values = np.array([np.nan, np.inf, -np.inf, -0.0, 5e-324, 1.7976931348623157e308, 0.1, 1 / 3])
    data = run.data.copy(deep=True)
    data["q"][0, : len(values), 0] = values
    data["count"] = (("rollout", "time"), np.arange(data["s"].size).reshape(data["s"].shape))
    data["single"] = data["s"].astype(np.float32)
    changed = run.with_data(data)
    loaded = pc.Run.load(changed.save(tmp_path / "run.mcap"))
    for name in data.data_vars:
        before, after = data[name].to_numpy(), loaded.data[name].to_numpy()
        assert before.dtype == after.dtype
        assert before.tobytes() == after.tobytes(), name


@given(st.lists(st.floats(allow_nan=True), min_size=1, max_size=20), st.text(min_size=1, max_size=8))
@settings(max_examples=50, deadline=None)
def test_messages_are_json_by_the_book_and_exact(numbers, joint):
    array = np.array(numbers)
    form = MessageFormat([Variable("x", True, "<f8", {}), Variable("y", False, "<f8", {})], [joint])
    messages = form.encode(np.arange(len(array), dtype=float), {"x": array[:, None], "y": array})
    for message in messages:
        json.loads(message, parse_constant=lambda word: pytest.fail(word))  # NaN and Infinity are no JSON
    _, arrays = form.decode(messages)
    np.testing.assert_array_equal(arrays["x"][:, 0], array)
    assert (np.signbit(arrays["y"]) == np.signbit(array))[~np.isnan(array)].all()


def test_the_file_is_what_the_reader_of_mcap_expects(run, tmp_path):
    """PlotJuggler and Foxglove take a JSON schema with the type of each field, and a topic for each rollout."""
    from mcap.reader import make_reader

    with run.save(tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert {channel.topic for channel in summary.channels.values()} == {"/arm/0", "/arm/1"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}
        (schema,) = (json.loads(schema.data) for schema in summary.schemas.values())
        assert schema["properties"]["q"]["properties"]["joint_1"] == {"type": "number"}
        assert "[rad]" in schema["properties"]["q"]["description"]
        assert summary.statistics.message_count == 2 * len(run.time)
        for k, (_, channel, message) in enumerate(reader.iter_messages(topics=["/arm/1"])):
            sample = json.loads(message.data)
            assert message.log_time == round(run.time[k] * 1e9)
            assert sample["q"] == {"joint_1": run.array("q")[1, k, 0], "joint_2": run.array("q")[1, k, 1]}
            assert channel.message_encoding == "json"


def test_a_file_that_ends_anywhere_is_read_as_far_as_it_goes_or_refused(run, tmp_path):
    from pathcontrol.simulation.storage.mcap_run import McapRunWriter, read_mcap

    content = _in_small_chunks(McapRunWriter, run)
    full, path, lengths = len(run.time), tmp_path / "cut.mcap", []
    for end in range(0, len(content) - 1, max(1, len(content) // 60)):
        path.write_bytes(content[:end])
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                data, _, _ = read_mcap(path)
            except InputError:
                assert not lengths  # once there is a sample, no file is refused
                continue
        assert "has no end" in str(told[-1].message)
        k = data.sizes["time"]
        lengths.append(k)
        assert (data["q"].to_numpy() == run.array("q")[:, :k]).all()
        assert (data["status"] == "running").all() or k == full
    assert lengths == sorted(lengths)
    assert lengths[-1] == full
    assert len(set(lengths)) > 3


def _in_small_chunks(writer, run):
    """The bytes of a file of many chunks."""
    from pathcontrol.simulation.storage import mcap_run

    stream = io.BytesIO()
    variables, coordinates = run.data.copy(), {}
    labels, axes = mcap_run._label(variables)
    fields = [Variable(name, len(dims) == 3, array.dtype.str, about) for name, (dims, array, about) in labels.items()]
    made = writer(stream, fields, mcap_run._describe_axes(axes), run.config, run._stored(), chunk=4000)
    made.write(run.time, {name: array for name, (_, array, _) in labels.items()})
    coordinates = {name: one for name, one in axes.items() if name not in ("rollout", "time", "joint")}
    made.finish(coordinates, list(coordinates))
    return stream.getvalue()


def test_a_byte_that_was_changed_is_noticed(run, tmp_path):
    content = run.save(tmp_path / "run.mcap").read_bytes()
    rng, path = np.random.default_rng(0), tmp_path / "damaged.mcap"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PathControlWarning)
        for _ in range(40):
            damaged = bytearray(content)
            damaged[int(rng.integers(len(content) // 2))] ^= 1 << int(rng.integers(8))
            path.write_bytes(damaged)
            with pytest.raises(PathControlError, match=r"damaged|not a run"):
                pc.Run.load(path)


def test_other_files_are_refused_with_what_to_do(tmp_path):
    from mcap.writer import Writer

    other = tmp_path / "other.mcap"
    with other.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    with pytest.raises(InputError, match=r"Run\.from_log"):
        pc.Run.load(other)
    text = tmp_path / "text.mcap"
    text.write_text("time, q")
    with pytest.raises(InputError, match="no MCAP file"):
        pc.Run.load(text)
    with pytest.raises(InputError, match="there is no file"):
        pc.Run.load(tmp_path / "missing.mcap")


def test_without_the_extra_it_is_said_which_one(run, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(pc.MissingExtraError, match=r"pathcontrol\[mcap\]"):
        run.save(tmp_path / "run.mcap")
    assert not list(tmp_path.iterdir())
