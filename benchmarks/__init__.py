"""Measurements, never tests: ``python -m benchmarks`` for the speed of simulations, the scripts for the rest."""
