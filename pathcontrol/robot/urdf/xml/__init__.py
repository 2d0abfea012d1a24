"""From the bytes of a URDF file to its elements."""
