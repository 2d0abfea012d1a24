"""Many simulations over a space of parameters: reduced to numbers on the fly, and kept chunk by chunk on disk."""
