"""Tasks that differ from rollout to rollout."""
