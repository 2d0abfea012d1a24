"""A path given by formulas in s."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import repeat
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Form, Speed
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.domain import refuse_two_rates, take_domain
from pathcontrol.tasks.profile import ConstantSpeed
from pathcontrol.tasks.symbolic.functions import compile_expressions, derivatives
from pathcontrol.tasks.symbolic.parser import RESERVED, number, parse
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    import sympy

Formula = Any  # a sympy expression, a text or a number


class SymbolicPath(PathTask):
    """A path and, if wanted, a velocity profile given as sympy expressions of s; all derivatives are exact.

    Expressions may be texts: numbers, + - * / **, brackets, pi, E, the elementary functions, s and the parameters.
    A text is read, never run. All that a controller asks for is compiled once into one function that computes common
    parts once.

    Args:
        q_d: q_d(s) [rad], one expression for each joint.
        speed: path speed ‖q̇‖ [rad/s]; or give ``theta``.
        theta: ϑ(s) > 0 [1/s].
        s: the symbol of the path parameter, or its name; symbols are told apart by their names.
        s0: first path parameter.
        s_end: last path parameter of an open path.
        period: period of q_d and ϑ of a closed path.
        parameters: values of the other symbols, by name or symbol.

    Raises:
        UnknownNameError: an expression has a symbol that is neither s nor a parameter.
        InputError: an expression is not understood, not real or not twice differentiable; the domain is empty; both or
            none of speed and theta are given.
    """

    def __init__(
        self,
        q_d: Annotated[Iterable[Formula], Form.FORMULAS],
        speed: Speed | None = None,
        *,
        theta: Annotated[Formula, Form.FORMULA] | None = None,
        s: Annotated[Formula, Form.TEXT] = "s",
        s0: float = 0.0,
        s_end: float = np.inf,
        period: float | None = None,
        parameters: Mapping[Any, float] | None = None,
    ) -> None:
        take_domain(self, s0, s_end, period)
        refuse_two_rates(speed, theta)
        self.speed = None if speed is None else as_scalar("speed", speed, positive=True)
        self.parameters = {str(key): as_scalar(f"parameters[{str(key)!r}]", v) for key, v in (parameters or {}).items()}
        self._s = _symbol(s, self.parameters)
        given = {f"q_d[{i}]": formula for i, formula in enumerate(_check_formulas(q_d))}
        if theta is not None:
            given["theta"] = theta
        self.formulas = {label: self._read(label, formula, values=False) for label, formula in given.items()}
        self._expressions = self._differentiate(given)
        self._functions: dict[tuple[str, ...], Callable[[Array], list[Any]]] = {}

    def q_d(self, s: Array) -> Array:
        return self._evaluate(s, "q_d")[0]

    def dq_d(self, s: Array) -> Array:
        return self._evaluate(s, "dq_d")[0]

    def ddq_d(self, s: Array) -> Array:
        return self._evaluate(s, "ddq_d")[0]

    def theta(self, s: Array) -> Array:
        if self.speed is not None:
            return ConstantSpeed(self.speed).theta(self, s)
        return self._evaluate(s, "theta")[0][..., 0]

    def dtheta(self, s: Array) -> Array:
        if self.speed is not None:
            return ConstantSpeed(self.speed).dtheta(self, s)
        return self._evaluate(s, "dtheta")[0][..., 0]

    def at(self, s: Array) -> PathPoint:
        path = ("q_d", "dq_d", "ddq_d")
        if self.speed is None:
            q_d, dq_d, ddq_d, theta, dtheta = self._evaluate(s, *path, "theta", "dtheta")
            return PathPoint(q_d, dq_d, ddq_d, theta[..., 0], dtheta[..., 0])
        q_d, dq_d, ddq_d = self._evaluate(s, *path)
        return PathPoint(q_d, dq_d, ddq_d, *ConstantSpeed(self.speed).at(dq_d, ddq_d, self, s))

    def latex(self) -> str:
        """Return q_d(s) and ϑ(s) in LaTeX, for a report, with parameters by their names."""
        import sympy

        s = sympy.latex(self._s)
        *path, theta = [*self.formulas.values()] if self.speed is None else [*self.formulas.values(), None]
        rate = rf"\frac{{{self.speed:g}}}{{\lVert q_d'({s}) \rVert}}" if theta is None else sympy.latex(theta)
        return rf"q_d({s}) = {sympy.latex(sympy.Matrix(path))}, \qquad \vartheta({s}) = {rate}"

    def describe(self) -> dict[str, Any]:
        texts = {label: str(formula) for label, formula in self.formulas.items()}
        return super().describe() | {"s": str(self._s), "formulas": texts, "parameters": self.parameters}

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_functions": {}}  # compiled anew where it is needed

    # --- from formulas to functions -------------------------------------------------------------------------

    def _read(self, label: str, formula: Formula, values: bool) -> sympy.Expr:
        """Read ``formula`` as an expression of our s, with its parameters replaced by ``values`` or left as symbols."""
        import sympy

        names = {k: number(v) if values else sympy.Symbol(k, real=True) for k, v in self.parameters.items()}
        names = {self._s.name: self._s} | names
        if isinstance(formula, str):
            return parse(label, formula, names)
        if not isinstance(formula, sympy.Expr):
            return number(as_scalar(label, formula))
        unknown = sorted({symbol.name for symbol in formula.free_symbols} - set(names))
        if unknown:
            raise UnknownNameError(
                f"{label} = {formula} has the symbol {unknown[0]!r}, expected {', '.join(names)}; "
                f"give parameters={{{unknown[0]!r}: …}}, or s={unknown[0]!r} if it is the path parameter",
                argument=label,
                value=unknown[0],
                choices=tuple(names),
            )
        return formula.subs({symbol: names[symbol.name] for symbol in formula.free_symbols})

    def _differentiate(self, given: dict[str, Formula]) -> dict[str, list[sympy.Expr]]:
        """Return the expressions of q_d, q_d', q_d'', ϑ and ϑ', checked."""
        rows = {}
        for label, formula in given.items():
            expression = self._read(label, formula, values=True)
            rows[label] = [expression, *derivatives(label, expression, self._s, isinstance(formula, str))]
        theta = rows.pop("theta", None)
        path = {name: [row[order] for row in rows.values()] for order, name in enumerate(("q_d", "dq_d", "ddq_d"))}
        return path if theta is None else path | {"theta": [theta[0]], "dtheta": [theta[1]]}

    def _evaluate(self, s: Array, *names: str) -> list[Array]:
        """Return the values of the named groups of expressions, (*batch, expressions) each."""
        if names not in self._functions:
            self._functions[names] = compile_expressions(
                self._s, [e for name in names for e in self._expressions[name]]
            )
        s = np.asarray(s, dtype=np.float64)
        with np.errstate(all="ignore"):  # check_task finds what is not finite
            try:
                values = iter(self._functions[names](s))
            except (ArithmeticError, TypeError):  # of constants that are infinite or complex
                values = repeat(np.nan)
        groups = [np.empty((*s.shape, len(self._expressions[name]))) for name in names]
        for group in groups:
            for i in range(group.shape[-1]):
                value = next(values)
                group[..., i] = np.nan if np.iscomplexobj(value) else value  # constants broadcast
        return groups


def _symbol(s: Any, parameters: Mapping[str, float]) -> sympy.Symbol:
    import sympy

    for name in (str(s), *parameters):
        if not name.isidentifier() or name in RESERVED:
            raise InputError(
                f"{name!r} is no name for a symbol, expected letters and digits and no name of a function", value=name
            )
    if str(s) in parameters:
        raise InputError(
            f"{str(s)!r} is the path parameter and among parameters; leave it out there, or rename s",
            argument="s",
            value=str(s),
        )
    return sympy.Symbol(str(s), real=True)


def _check_formulas(q_d: Iterable[Formula]) -> list[Formula]:
    """Check that there is a list of formulas, one for each joint."""
    if isinstance(q_d, str) or not isinstance(q_d, Iterable):
        raise InputError(
            f"q_d = {q_d!r}, expected a list with one expression for each joint", argument="q_d", value=q_d
        )
    formulas = list(q_d)
    if not formulas:
        raise InputError("q_d has no expressions, expected one for each joint", argument="q_d", value=[])
    return formulas
