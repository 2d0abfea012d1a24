"""The scene of an animation: arms, lines, markers, camera and how they move."""
