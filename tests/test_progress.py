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
