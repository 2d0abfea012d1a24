"""A speed rule whose factor and rate are given, for tests of theorems at any speed."""

import numpy as np

import pathcontrol as pc


class Given(pc.SpeedRule):
    """A factor w whose rate ẇ is given."""

    def __init__(self, w, wdot):
        self.w, self.wdot = np.asarray(w), np.asarray(wdot)

    def start(self, law, q, qd, s):
        return np.broadcast_to(self.w, s.shape)[..., None]

    def rate(self, moment, asked, x):
        return np.broadcast_to(self.wdot, x.shape[:-1])

    def describe(self):
        return {}
