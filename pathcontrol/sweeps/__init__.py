"""Sweeps: many simulations over a space of parameters, reduced to numbers and kept chunk by chunk on disk."""
