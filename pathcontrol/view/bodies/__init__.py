"""The shapes of an arm: the visuals of its URDF, their meshes, or sticks in their place."""
