"""Messages on the command line speak of the command's own options, and advise nothing that it has no option for."""

from __future__ import annotations

import ast
import itertools
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import pathcontrol
from pathcontrol.cli import main
from pathcontrol.cli.group import in_options
from pathcontrol.experiments.builders.file_errors import report_by_key

SOURCE = Path(pathcontrol.__file__).parent
KEYWORD = re.compile(r"(?<![-\w.&?#/=$'])(?<!\w\()([a-z_]\w*)=(?![=\d])")


def messages():
    """Texts of the package that errors and warnings may say and that name an argument by ``name=``, and where."""
    for file in sorted(SOURCE.rglob("*.py")):
        source = file.read_text(encoding="utf-8")
        if not re.search(r"Error\(|\bwarn\(", source):
            continue
        for node in ast.walk(ast.parse(source)):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if not name.endswith("Error") and name != "warn":
                continue
            for text in node.args:
                said = _text(text)
                if said and KEYWORD.search(_without_quoted(said)):
                    yield f"{file.stem}:{node.lineno}", said


def _text(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "thing" for part in node.values)
    if isinstance(node, ast.BinOp):
        return (_text(node.left) or "") + (_text(node.right) or "thing")
    return None


def _without_quoted(text):
    return re.sub(r"`[^`]*`|<[^>]*>|(?<![=\w])'[^']*'", "", text)


def test_no_command_speaks_of_arguments_of_python():
    found = list(messages())
    for (where, message), (name, command) in itertools.product(found, main.commands.items()):
        said = in_options(message, command)
        left = KEYWORD.findall(_without_quoted(said))
        assert not left or message.startswith(left[0]), (where, name, said)
        for option in re.findall(r"(?<![-\w])--[a-z][-a-z0-9]*", _without_quoted(said)):
            known = {word for param in command.params for word in param.opts}
            assert option in known or option in message, (where, name, said)
    assert len(found) > 10


@pytest.mark.parametrize(
    ("command", "message", "said"),
    [
        ("toolpath", "TEXT; choose with layers= from A, B", "TEXT; choose with --layer from A, B"),
        ("toolpath", "'a=4', or pass it over with unknown='warn'", "'a=4', or pass it over with --lenient"),
        ("toolpath", "give unit='mm' or unit='in'", "give --unit mm or --unit in"),
        ("toolpath", "read the file with start=(x, y, z)", "read the file with --start x y z"),
        ("toolpath", "ppi = -1, expected a number", "--ppi -1, expected a number"),
        ("sweep", "cluster = '127.0.0.1:1': no Dask, (a, b); c", "--cluster 127.0.0.1:1: no Dask, (a, b); c"),
        ("sweep", 'cluster = "it\'s:1": no Dask; start one', "--cluster it's:1: no Dask; start one"),
        ("sweep", "cluster = <Client: 'tcp://a, b'>: no Dask; c", "--cluster <Client: 'tcp://a, b'>: no Dask; c"),
        ("sweep", "chunk = 1 s is less: than, it", "--chunk 1 s is less: than, it"),
        ("toolpath", "start = [1, 2], expected more", "--start 1 2, expected more"),
        ("toolpath", "layers = ['a', 'b'], of which", "--layer a --layer b, of which"),
        ("toolpath", "layers: there is no layer 'a'", "--layer: there is no layer 'a'"),
        ("view", "no robot; give robot=load_robot(...)", "no robot; give --robot FILE"),
        ("view", "no path, as it holds data only; give task=…", "no path, as it holds data only"),
        ("view", "no path; give task=…, or to simulate(…, task=…)", "no path"),
        ("check", "TEXT; take it away, or skip=['a', 'b'] it", "TEXT; take it away"),
        ("toolpath", "TEXT; take it, none=['a'] it, pass unknown='warn', or b", "TEXT; take it, pass --lenient, or b"),
        ("check", "a joint (closed=[...] locks it) moves; see", "a joint moves; see"),
        ("check", "wrong; closed=False makes it open; try another", "wrong; try another"),
        ("check", "<joint name='a'> is odd; `dask --n=1` too", "<joint name='a'> is odd; `dask --n=1` too"),
        ("view", "Circle.theta(s=3.1) = 0, expected more", "Circle.theta(s=3.1) = 0, expected more"),
    ],
)
def test_advice_is_translated_or_left_out(command, message, said):
    assert in_options(message, main.commands[command]) == said


def test_keyed_errors_speak_of_lines_of_the_file():
    from pathcontrol.errors import ExperimentError, ToolpathError

    with pytest.raises(ExperimentError) as error, report_by_key("task.file", ("unit", "layers")):
        raise ToolpathError("no unit; give unit='mm', or choose layers= of A; or read it with start=(x, y, z)")
    said, _, place = str(error.value).partition(" (")  # this file is the user's code here
    assert said == 'task.file: no unit; give unit = "mm", or choose layers = of A'
    assert place.startswith("test_advice.py, line ")


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def test_a_feed_and_a_start_may_have_units(tmp_path):
    import json

    file = tmp_path / "square.csv"
    file.write_text("x [mm],y [mm],z [mm]\n0,0,0\n10,0,0\n10,10,0\n", encoding="utf-8")
    done = [run("toolpath", file, "--feed", feed, "--json") for feed in ("0.05", "50 mm/s", "3 m/min")]
    assert [json.loads(one.stdout)["contours"][0]["feed_m_s"] for one in done] == [0.05] * 3
    program = tmp_path / "cut.ngc"
    program.write_text("G21 G90 F300\nG1 X10\n", encoding="utf-8")
    done = [
        run("toolpath", program, "--start", *start, "--json") for start in (("0", "0.001", "0"), ("0 m", "1 mm", "0"))
    ]
    assert done[0].exit_code == 0, done[0].output
    assert done[0].stdout == done[1].stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--feed", "50 kg"), "m/s (mm/s"),
        (("--feed", "fast"), "expected a number with a unit"),
        (("--start", "0", "1 s", "0"), "m (mm, cm"),
    ],
)
def test_a_unit_of_another_dimension_is_refused_by_its_option(tmp_path, words, said):
    done = run("toolpath", tmp_path / "square.csv", *words)
    assert done.exit_code == 2
    assert words[0] in done.output
    assert said in " ".join(done.output.split())


def test_a_feed_of_50_is_questioned(tmp_path):
    file = tmp_path / "square.csv"
    file.write_text("x [mm],y [mm],z [mm]\n0,0,0\n10,0,0\n10,10,0\n", encoding="utf-8")
    assert "warning: --feed 50 is 50 m/s" in run("toolpath", file, "--feed", "50").stderr
    assert "warning" not in run("toolpath", file, "--feed", "50 mm/s").stderr
