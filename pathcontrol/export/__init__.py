"""Trajectories for controllers of arms: what a task plans, and files that machines read."""
