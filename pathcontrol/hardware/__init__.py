"""Control loops for real arms: a law behind a safety envelope."""
