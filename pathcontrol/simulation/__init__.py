"""The simulated arm, the loop around it, and the record of a run."""
