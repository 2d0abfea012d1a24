"""Control laws: motion control and path control."""
