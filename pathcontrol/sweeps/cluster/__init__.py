"""Sweeps on a Dask cluster."""
