"""The square root that is printed below (39) has lost a sign: what it does to an arm that turns clockwise.

Draws the errors on the paper's circle, gone round clockwise, of the law as it is printed and of the law of the library.
Usage: python examples/lost_sign.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")


class PrintedProjection(pc.Projection):
    """Projection on a circle with √(‖q‖²‖q̇‖² − (qᵀq̇)²)/‖q‖² = |θ̇| in place of θ̇, the rate at which the arm turns."""

    def project(self, q, qd, near):
        found = super().project(q, qd, near)
        rate = np.vecdot(found.position_gradient, qd)
        turning = -rate if self.task.clockwise else rate
        printed = np.where(turning < 0, -1.0, 1.0)[..., None]
        return found._replace(position_gradient=found.position_gradient * printed)


robot = pc.load_robot("cicese_2dof").with_friction(None)
laws = {"as printed": PrintedProjection, "with its sign": pc.Projection}

# the paper's circle and gains, the other way round
k_p, K_v = 800.0, [45.0, 100.0]
task = pc.Circle(radius=1.0, speed=2.0, clockwise=True)
runs = {}
for name, make in laws.items():
    law = make(robot, task, k_p, K_v)
    runs[name] = run = pc.simulate(law, np.deg2rad([40.0, -70.0]), duration=2.0)
    error, V = np.rad2deg(pc.peak(pc.steady_state(run).norm("e_p"))[0]), pc.lyapunov(law, run).V[0]
    print(f"{name}: {error:.3f} deg beside the path; V from {V[0]:.1f} to {V[-1]:.1e}")
print(f"2 v²/(r k_p): {np.rad2deg(2 * task.speed**2 / (task.radius * k_p)):.3f} deg")
pc.save_figure(pc.error_figure(runs), out / "lost_sign")
