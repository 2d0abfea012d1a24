"""Batches of tasks, which differ from rollout to rollout."""
