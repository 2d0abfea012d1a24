"""Time-optimal traversal of a path: the limits along it, what each cell of the grid allows, and the sweeps."""
