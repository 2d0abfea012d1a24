"""What an arm looks like: the visuals of its URDF, their meshes, or sticks in their place."""
