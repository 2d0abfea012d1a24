"""Observers in the loop from experiment files: in runs, saved runs, reports and sweeps."""

from __future__ import annotations

from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol import (
    Circle,
    Projection,
    Run,
    SampledLoop,
    load_robot,
    metrics,
    report,
    run_experiment,
    run_sweep,
    simulate,
)

CICESE = load_robot("cicese_2dof")
FILE = """
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "projection"
k_p = 800.0
K_v = [45.0, 100.0]
friction = "observed"
observer_hz = "25 Hz"
[loop]
encoders = true
[start]
q = [0.7, 1.2]
"""


def test_a_file_a_saved_run_and_a_report_have_it(tmp_path, monkeypatch):
    (tmp_path / "one.toml").write_text("duration = 0.2\n" + FILE, encoding="utf-8")
    run = run_experiment(tmp_path / "one.toml", tmp_path / "out", progress=False).run
    same = Projection(CICESE, Circle(1.0, 2.0), 800.0, [45.0, 100.0], friction="observed", observer_hz=25.0)
    loop = SampledLoop(encoders=True)
    again = simulate(same, [0.7, 1.2], duration=0.2, loop=loop, progress=False)
    assert_array_equal(again.array("q"), run.array("q"))
    again.save(tmp_path / "again.nc")
    saved = Run.load(tmp_path / "again.nc")
    assert saved.config["controller"]["friction"] == "observed"
    assert saved.config["controller"]["observer_hz"] == 25.0
    monkeypatch.setattr("pathcontrol.view.report.pictures._draw", lambda figure: ("png", b""))
    page = report({"again": saved}, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "observer_hz=25.0" in page
    assert "Torques beside those of motors, which the law compensates" in page
    assert "Torques beside those of motors and friction" not in page


def test_its_cutoff_is_swept_in_one_batch(tmp_path):
    text = FILE + '[sweep]\nmethod = "grid"\n[sweep.parameters]\n"controller.observer_hz" = { grid = [10.0, 40.0] }\n'
    (tmp_path / "sweep.toml").write_text("duration = 0.5\n" + text, encoding="utf-8")
    found = run_sweep(tmp_path / "sweep.toml", tmp_path / "swept", progress=False)
    for i, cutoff in enumerate((10.0, 40.0)):
        one = Projection(CICESE, Circle(1.0, 2.0), 800.0, [45.0, 100.0], friction="observed", observer_hz=cutoff)
        run = simulate(one, [0.7, 1.2], duration=0.5, loop=SampledLoop(encoders=True), progress=False)
        assert_allclose(found.table()["e_v_peak"][i], metrics(run)["e_v_peak"][0], rtol=1e-9)
