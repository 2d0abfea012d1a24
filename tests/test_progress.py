"""The progress bar: drawn after two seconds, without a thread."""

import threading

import pytest

from pathcontrol import _progress
from pathcontrol._progress import progress_bar


@pytest.fixture
def terminal(monkeypatch):
    """Have rich take standard error for a terminal."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")


def test_a_bar_that_is_shown_has_no_thread_that_a_fork_would_lose(terminal, monkeypatch, capsys):
    monkeypatch.setattr(_progress, "_PATIENCE", 0.0)
    before = threading.active_count()
    with progress_bar("going round", 4) as update:
        update(1)
        assert threading.active_count() == before
    drawn = capsys.readouterr().err
    assert "going round" in drawn
    assert "25%" in drawn


def test_what_is_quick_or_silenced_draws_nothing(terminal, monkeypatch, capsys):
    with progress_bar("quick", 2) as update:
        update(1)
    monkeypatch.setattr(_progress, "_PATIENCE", 0.0)
    with progress_bar("silenced", 2, enabled=False) as update:
        update(1)
    assert capsys.readouterr().err == ""


def test_updates_that_follow_each_other_at_once_are_drawn_once(terminal, monkeypatch, capsys):
    monkeypatch.setattr(_progress, "_PATIENCE", 0.0)
    monkeypatch.setattr(_progress, "_BETWEEN", 3600.0)
    with progress_bar("many", 100) as update:
        for done in range(100):
            update(done)
    assert "99%" not in capsys.readouterr().err


def test_a_file_gets_nothing_of_a_bar(monkeypatch, capfd):
    monkeypatch.setattr(_progress, "_PATIENCE", 0.0)
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    with progress_bar("into a file", 4) as update:
        update(1)
    assert capfd.readouterr().err == ""


def stop_at(done, total):
    """A task that Ctrl-C ends."""
    with progress_bar("interrupted", total) as update:
        update(done)
        raise KeyboardInterrupt


def test_what_ends_early_ends_at_the_whole(terminal, monkeypatch, capsys):
    """An arm that is done before its longest duration has done all of it; one that failed has not."""
    monkeypatch.setattr(_progress, "_PATIENCE", 0.0)
    with progress_bar("done early", 100) as update:
        update(42)
    assert "100%" in capsys.readouterr().err
    with pytest.raises(KeyboardInterrupt):
        stop_at(42, 100)
    assert "100%" not in capsys.readouterr().err


def test_steps_that_are_slow_are_announced_at_once(terminal, capsys):
    with progress_bar("drawing", 5, at_once=True) as update:
        update(0)
        assert "drawing" in capsys.readouterr().err
