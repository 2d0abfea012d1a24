"""The balance of the Lyapunov function of a law along a run: what it predicts, what was measured, and why they part."""
