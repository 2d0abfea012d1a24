"""Experiment files: a robot, a task, a controller, a plant and a loop in one TOML file, and what to write of the run."""
