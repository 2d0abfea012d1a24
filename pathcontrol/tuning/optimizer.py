"""The optimiser: whole generations of points in the unit cube, from pymoo."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._extras import load_extra
from pathcontrol.sweeps.space import unit_cube

_STREAM = 0x74756E65  # a random stream apart from those of designs and of sensors


class Evaluation(NamedTuple):
    """The evaluation of N points.

    Attributes:
        costs: values to minimise, (N, d), finite.
        violations: the excess over each limit, (N, m), at most 0 within it.
    """

    costs: Array
    violations: Array


class Search:
    """A search by generations of points, with evolutionary algorithms.

    Several costs are searched by NSGA-II (K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, A fast and elitist
    multiobjective genetic algorithm: NSGA-II, IEEE Trans. Evolutionary Computation 6, 2002), a single one by
    differential evolution (R. Storn and K. Price, Differential evolution, J. Global Optimization 11, 1997). The first
    generation is a Latin hypercube. A point within the limits is better than any beyond them, and of two beyond them
    the one that exceeds them less. The same seed gives the same points.

    Args:
        width: dimension of the cube.
        goals: numbers of costs and of limits.
        population: points in a generation.
        seed: seed of the random numbers.

    Raises:
        MissingExtraError: pymoo is not installed.
    """

    def __init__(self, width: int, goals: tuple[int, int], population: int, seed: int) -> None:
        nsga2 = load_extra("pymoo.algorithms.moo.nsga2", "tune", "tuning")
        from pymoo.algorithms.soo.nonconvex.de import DE
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        first, later = SeedSequence(seed, spawn_key=(_STREAM,)).generate_state(2).tolist()
        problem = Problem(n_var=width, n_obj=goals[0], n_ieq_constr=goals[1], xl=0.0, xu=1.0)
        single = partial(DE, variant="DE/best/1/bin", CR=0.9)  # gains depend on one another
        kind = nsga2.NSGA2 if goals[0] > 1 else single
        self._algorithm: Any = kind(pop_size=population, sampling=unit_cube("lhs", population, width, first))
        self._algorithm.setup(problem, termination=NoTermination(), seed=later)
        self._asked: Any = None

    def ask(self) -> NDArray[np.float64]:
        """Return the points of the next generation, (N, width)."""
        self._asked = self._algorithm.ask()
        return self._asked.get("X").astype(np.float64)

    def tell(self, evaluation: Evaluation) -> None:
        """Set the evaluation of the points returned last."""
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        known = StaticProblem(self._algorithm.problem, F=evaluation.costs, G=evaluation.violations)
        Evaluator().eval(known, self._asked)
        self._algorithm.tell(infills=self._asked)
