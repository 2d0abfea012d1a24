"""The laws of a run that have a momentum observer, by its configuration."""

from __future__ import annotations

from pathcontrol.simulation.config import laws
from pathcontrol.simulation.run import Run


def compensates_observed(run: Run) -> bool:
    """Return whether a law of the run compensates what it observes, ``friction="observed"``."""
    return any(law.get("friction") == "observed" for law in laws(run.config))


def halts_at_contacts(run: Run) -> bool:
    """Return whether a law of the run is an ``EventPlan``, or has one inside."""
    return any("EventPlan(" in str(law.get("controller")) for law in laws(run.config))
