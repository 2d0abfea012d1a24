"""What is asked of the arm: paths and velocity profiles."""
