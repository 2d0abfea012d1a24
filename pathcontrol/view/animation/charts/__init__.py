"""Charts beside an animation."""
