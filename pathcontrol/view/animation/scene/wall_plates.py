"""The plates of walls in the scene."""

from __future__ import annotations

from collections.abc import Sequence

from pathcontrol._arrays import Array
from pathcontrol.view.animation.drawn_rollout import DrawnRollout
from pathcontrol.view.animation.scene.scene_builder import Stage


def add_plates(stage: Stage, drawn_rollouts: Sequence[DrawnRollout], shifts: Array, ghosted: bool) -> None:
    """Draw the walls before each arm; one that was drawn for a ghost is not drawn again for the next."""
    for i, (drawn_rollout, shift) in enumerate(zip(drawn_rollouts, shifts, strict=True)):
        earlier = [plate for other in drawn_rollouts[:i] for plate in other.plates] if ghosted else []
        for k, plate in enumerate(drawn_rollout.plates):
            if not any(plate.looks_like(other) for other in earlier):
                stage.add_plate(f"walls/{i} {k}", plate, shift)
