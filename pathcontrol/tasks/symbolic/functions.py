"""Derivatives of expressions of s, and their compilation to functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    import sympy

#: functions of sympy that are not twice continuously differentiable, and what differentiating an unknown one leaves
_ROUGH = (
    *("Abs", "sign", "Heaviside", "DiracDelta", "Max", "Min", "Piecewise", "Mod", "floor", "ceiling", "frac"),
    *("re", "im", "arg", "Derivative", "Subs"),
)
_LARGEST = 3000  # operations in the derivative of a text; that of a long product has many times more than the product


def derivatives(label: str, formula: sympy.Expr, s: sympy.Symbol, bounded: bool) -> list[sympy.Expr]:
    """Return the first and the second derivative of a formula by s.

    Args:
        label: what it is called in messages.
        formula: a sympy expression.
        s: the symbol of the path parameter.
        bounded: whether to refuse a formula that only a text from a stranger would have.

    Raises:
        InputError: it is not twice continuously differentiable where it is defined, not real, or too large.
    """
    import sympy

    try:
        first = formula.diff(s)
        if bounded and first.count_ops() > _LARGEST:
            raise InputError(
                f"the derivative of {label} has more than {_LARGEST} operations; simplify the formula",
                argument=label,
                value=str(formula),
                limit=_LARGEST,
            )
        second = first.diff(s)
    except (RecursionError, TypeError, ArithmeticError) as error:
        raise InputError(
            f"{label} cannot be differentiated ({error}); simplify it", argument=label, value=str(formula)
        ) from None
    rough = [a for e in (formula, first, second) for a in e.atoms(*(getattr(sympy, r) for r in _ROUGH)) if a.has(s)]
    if rough:
        raise InputError(
            f"{label} = {formula} is not twice continuously differentiable: it or a derivative of it has {rough[0]}; "
            "write it with smooth functions, or give a FunctionPath with its derivatives",
            argument=label,
            value=str(formula),
        )
    # a negative number to the power s has a complex derivative only
    if any(e.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo, -sympy.oo) for e in (formula, first, second)):
        raise InputError(f"{label} = {formula}, expected a real, finite expression", argument=label, value=str(formula))
    return [first, second]


def compile_expressions(s: sympy.Symbol, expressions: list[sympy.Expr]) -> Callable[[Array], list[Any]]:
    """Compile ``expressions`` to one function of s (*batch,), whose values are each (*batch,) or a number."""
    import sympy

    # NumPy makes objects of integers longer than its own
    long = {a: sympy.Float(a) for e in expressions for a in e.atoms(sympy.Rational) if max(abs(a.p), a.q) >= 2**53}
    try:
        return sympy.lambdify([s], [e.xreplace(long) for e in expressions], modules=["scipy", "numpy"], cse=True)
    except (RecursionError, MemoryError, SyntaxError, TypeError, ArithmeticError) as error:
        raise InputError(f"the expressions cannot be compiled ({error}); simplify them") from None
