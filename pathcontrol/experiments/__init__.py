"""Experiment files: robot, task, controller, plant, loop and outputs of one run in a TOML file."""
