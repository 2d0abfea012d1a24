"""What runs and states say: distances, errors, Lyapunov functions."""
