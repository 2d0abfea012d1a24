"""The samples of a sweep: grids, random points, Latin hypercubes, Sobol sequences, or given ones."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.random import SeedSequence, default_rng

from pathcontrol._arrays import Array, check_whole
from pathcontrol.errors import InputError

MOST_SAMPLES, MOST_NUMBERS = 10**7, 10**8  # limits of what is in memory together
_TOLD = 100  # values that a record lists; of more, their number and a digest


class Choice(NamedTuple):
    """Values to choose from, (m,) or (m, d)."""

    values: Array

    def at(self, u: Array) -> Array:
        """Return the values for u (N, 1) in [0, 1), each equally often."""
        return self.values[np.minimum((u[:, 0] * len(self.values)).astype(np.intp), len(self.values) - 1)]

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape () for numbers, (1,) for vectors, which are chosen as a whole."""
        return ()

    def describe(self) -> dict[str, Any]:
        """Return the values, for the definition of a sweep."""
        if len(self.values) <= _TOLD:
            return {"values": self.values.tolist()}
        return {"count": len(self.values), "sha256": digest([self.values])}


class Distribution(NamedTuple):
    """A frozen distribution of scipy.stats, for a number or for a vector whose components are independent."""

    frozen: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape () of a number, (d,) of a vector."""
        return np.shape(self.frozen.ppf(0.5))

    def at(self, u: Array) -> Array:
        """Return the quantiles at u (N, d)."""
        return np.asarray(self.frozen.ppf(u if self.shape else u[:, 0]))

    def describe(self) -> dict[str, Any]:
        """Return name and arguments, for the definition of a sweep."""
        kwds = {name: np.asarray(value).tolist() for name, value in self.frozen.kwds.items()}
        args = [np.asarray(value).tolist() for value in self.frozen.args]
        return {"distribution": self.frozen.dist.name, "args": args, **kwds}


class Space:
    """Named parameters with a rule to draw samples; make one with :meth:`grid`, :meth:`random` and so on.

    A parameter is a frozen distribution of ``scipy.stats``, such as ``stats.uniform(1, 4)`` or with arrays as its
    arguments that of a vector, or a list of values, of which each is as likely as any other. A value is a number, a
    text or a vector. Distributions are sampled at their quantiles of points in the unit cube.

    Attributes:
        names: names of the parameters.
        method: the rule by which samples are drawn.
        samples: number of samples.
    """

    def __init__(self, parameters: Mapping[str, Any], method: str, samples: int | None) -> None:
        if not isinstance(parameters, Mapping) or not parameters:
            raise InputError(
                f"parameters = {parameters!r}, expected a dict with a parameter at least",
                argument="parameters",
                value=parameters,
            )
        self._parameters = {str(name): _check_parameter(name, given) for name, given in parameters.items()}
        self.names, self.method = tuple(self._parameters), method
        self.samples = self._count_samples() if samples is None else check_whole("samples", samples)
        self._check_size()

    @classmethod
    def grid(cls, parameters: Mapping[str, Any]) -> Self:
        """Make a space with every combination of the values of all parameters; the last one changes first."""
        return cls(parameters, "grid", None)

    @classmethod
    def given(cls, parameters: Mapping[str, Any]) -> Self:
        """Make a space of given samples: for each parameter a value for each sample, (N,) or (N, d)."""
        return cls(parameters, "given", None)

    @classmethod
    def random(cls, parameters: Mapping[str, Any], samples: int) -> Self:
        """Make a space of independent random samples; fewer of them are the first ones of more."""
        return cls(parameters, "random", samples)

    @classmethod
    def latin_hypercube(cls, parameters: Mapping[str, Any], samples: int) -> Self:
        """Make a Latin hypercube: one sample of each parameter in each of N equally likely intervals."""
        return cls(parameters, "lhs", samples)

    @classmethod
    def sobol(cls, parameters: Mapping[str, Any], samples: int) -> Self:
        """Make a scrambled Sobol sequence; best with a power of 2 of samples, fewer are the first ones of more."""
        return cls(parameters, "sobol", samples)

    def design(self, seed: int = 0) -> dict[str, Array]:
        """Return all samples: the values of each parameter, (N,) or (N, d), which depend on ``seed`` alone."""
        if self.method == "grid":
            sizes = [len(values) for values in self._choices()]
            which = np.indices(sizes).reshape(len(sizes), -1)
            return {name: v[i] for name, v, i in zip(self.names, self._choices(), which, strict=True)}
        if self.method == "given":
            return dict(zip(self.names, self._choices(), strict=True))
        return self.at(unit_cube(self.method, self.samples, self.width, seed))

    @property
    def width(self) -> int:
        """The count of numbers in a sample: the components of all parameters."""
        return sum(self._widths())

    def at(self, cube: Array) -> dict[str, Array]:
        """Return the quantiles of each parameter at points (N, :attr:`width`) of the unit cube, (N,) or (N, d)."""
        ends = list(itertools.accumulate(self._widths()))
        inside = np.clip(cube, 2.0**-54, 1 - 2.0**-53)  # so that no quantile is infinite
        parts = np.split(inside, ends[:-1], axis=1)
        return {name: p.at(u) for (name, p), u in zip(self._parameters.items(), parts, strict=True)}

    def _widths(self) -> list[int]:
        """Return the number of components of each parameter."""
        return [math.prod(parameter.shape) for parameter in self._parameters.values()]

    def describe(self) -> dict[str, Any]:
        """Return everything that determines the samples, for the definition of a sweep."""
        parameters = {name: parameter.describe() for name, parameter in self._parameters.items()}
        return {"method": self.method, "samples": self.samples, "parameters": parameters}

    def _choices(self) -> list[Array]:
        """Return the values of all parameters that are lists."""
        return [parameter.values for parameter in self._parameters.values() if isinstance(parameter, Choice)]

    def _check_size(self) -> None:
        """Check that all samples fit into memory, before any is made.

        Raises:
            InputError: they do not.
        """
        most = min(MOST_SAMPLES, max(1, MOST_NUMBERS // max(1, self._count_numbers())))
        if self.samples > most:
            sizes = " × ".join(str(len(values)) for values in self._choices()) if self.method == "grid" else ""
            raise InputError(
                f"samples = {self.samples}{f' of a grid of {sizes}' if sizes else ''}, expected at most {most}, which "
                "are in memory together; take fewer"
                + (", as by Space.sobol or a coarser grid" if sizes else ", or several sweeps with a seed each"),
                argument="samples",
                value=self.samples,
                limit=most,
            )

    def _count_numbers(self) -> int:
        """Return the count of numbers in the parameters of a sample."""
        return sum(
            int(np.prod(p.values.shape[1:])) if isinstance(p, Choice) else math.prod(p.shape)
            for p in self._parameters.values()
        )

    def _count_samples(self) -> int:
        """Return the number of samples of a grid or of given ones."""
        for name, parameter in self._parameters.items():
            if not isinstance(parameter, Choice):
                kind = parameter.frozen.dist.name
                raise InputError(
                    f"{name} is a {kind} distribution, of which a {self.method} cannot have every value; give a list "
                    "of values, or use Space.random, latin_hypercube or sobol",
                    argument=name,
                )
        sizes = [len(values) for values in self._choices()]
        if self.method == "grid":
            return math.prod(sizes)
        if len(set(sizes)) > 1:
            listed = ", ".join(f"{name}: {size}" for name, size in zip(self.names, sizes, strict=True))
            raise InputError(
                f"the parameters have different numbers of samples ({listed}), expected the same", value=sizes
            )
        return sizes[0]


def digest(arrays: list[Array]) -> str:
    """Return the SHA-256 of the values, kinds and shapes of arrays."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def check_seed(seed: Any) -> int:
    """Check that a seed is a whole number from 0; return it."""
    return check_whole("seed", seed, 0)


def unit_cube(method: str, samples: int, width: int, seed: int) -> Array:
    """Return points (samples, width) of the unit cube."""
    from scipy.stats import qmc

    rng = default_rng(SeedSequence(check_seed(seed)))
    if method == "random":
        return rng.random((samples, width))
    if method == "lhs":
        return qmc.LatinHypercube(width, rng=rng).random(samples)
    return qmc.Sobol(width, rng=rng).random_base2((samples - 1).bit_length())[:samples]


def _check_parameter(name: str, given: Any) -> Choice | Distribution:
    """Check a parameter; return it as choice or distribution."""
    if hasattr(given, "ppf"):
        parameter = Distribution(given)
        median = np.asarray(given.ppf(0.5))
        if median.ndim > 1 or not np.isfinite(median).all():
            raise InputError(
                f"{name}: the distribution has the median {median.tolist()}, expected a number or vector",
                argument=name,
                value=median,
            )
        return parameter
    try:
        values = np.asarray(given)
    except ValueError as error:
        raise InputError(
            f"{name} = {given!r}, expected values of one kind and length", argument=name, value=given
        ) from error
    if values.dtype.kind not in "biufU" or values.ndim not in (1, 2) or not values.size:
        raise InputError(
            f"{name} = {given!r}, expected a list of numbers, texts or vectors, or a frozen distribution of "
            "scipy.stats, such as stats.uniform(1, 4)",
            argument=name,
            value=given,
        )
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        wrong = values[~np.isfinite(values)][0]
        raise InputError(f"{name} holds {wrong}, expected finite numbers", argument=name, value=wrong)
    return Choice(values)
