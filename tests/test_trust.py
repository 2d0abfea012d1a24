"""The page of threats and faults names tests that exist."""

import re
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = (TESTS.parent / "docs" / "trust.md").read_text(encoding="utf-8")


def test_every_test_that_the_page_names_exists():
    named = set(re.findall(r"`(test_\w+)`", PAGE))
    defined = {
        name for file in TESTS.rglob("test_*.py") for name in re.findall(r"^def (test_\w+)", file.read_text(), re.M)
    }
    assert len(named) > 20
    assert named <= defined


def test_every_fault_has_a_test():
    rows = re.findall(r"^\| (?!fault|from|---|\W*$)(.*) \|$", PAGE, re.M)
    assert len(rows) > 20
    assert all("`test_" in row or row.endswith("below") for row in rows if not row.startswith("--"))
