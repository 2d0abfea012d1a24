"""The simulated arm, the loop around it, and what comes out."""
