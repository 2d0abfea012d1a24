"""Tasks for the arm: paths and velocity profiles."""
