"""Time-optimal path parametrisation (TOPP): limits along the path, their form in each cell, and the passes."""
