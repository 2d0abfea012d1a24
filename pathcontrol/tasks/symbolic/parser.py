"""A parser of formulas in text to sympy expressions, which evaluates no code.

Only numbers, + - * / **, brackets and the functions and constants listed here are understood, and every constant part
must be a number that a float can hold; so a formula from a file can neither run code nor ask for endless work.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Mapping
from typing import Any

from pathcontrol.errors import InputError, UnknownNameError

_LONGEST = 3_000  # characters
_DEEPEST = 32  # levels of operations within operations
_EXACT_BITS = 256  # a power of constants that needs more is rounded to a float
_HIGHEST = 100  # power of s
_CONSTANTS = ("pi", "E")
_FUNCTIONS = {  # by the name in sympy; the value for a constant
    name: getattr(math, name)
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        *("exp", "log", "sqrt", "erf", "atan2"),
    )
}
_SUMS, _PRODUCTS = (ast.Add, ast.Sub), (ast.Mult, ast.Div)

#: names that stand for functions and constants
RESERVED = frozenset(_FUNCTIONS) | frozenset(_CONSTANTS)


class _FormulaError(Exception):
    """The reason why a formula is refused, without its label."""


def parse(label: str, text: str, names: Mapping[str, Any]) -> Any:
    """Parse ``text`` to a sympy expression, where ``names`` stand for the symbols or numbers given.

    Raises:
        UnknownNameError: a name in the formula is none of ``names``.
        InputError: the formula is none, or too long or too deep, or part of it is not a real, finite number.
    """
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    try:
        if len(text) > _LONGEST:
            raise _FormulaError(f"it has {len(text)} characters, at most {_LONGEST} are read")
        return _expression(_tree(text), names, _DEEPEST)
    except UnknownNameError as error:
        raise UnknownNameError(f"{label} = {shown!r}: {error}", **error.details_with(argument=label)) from None
    except _FormulaError as error:
        reason = str(error)
    except (ArithmeticError, TypeError, ValueError, RecursionError) as error:
        reason = f"sympy fails with {error!r}"
    raise InputError(
        f"{label} = {shown!r} is not understood: {reason}. A formula is made of numbers, + - * / **, brackets, "
        f"{', '.join(_CONSTANTS)}, {', '.join(_FUNCTIONS)} and {', '.join(names)}",
        argument=label,
        value=text,
    )


def number(value: float) -> Any:
    """Convert ``value`` for sympy, with whole numbers as integers: s**2 has simpler derivatives than s**2.0."""
    import sympy

    whole = abs(value) < 2**53 and float(value).is_integer()
    return sympy.Integer(int(value)) if whole else sympy.Float(value)


def _tree(text: str) -> ast.expr:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            return ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        raise _FormulaError(f"{error.msg} at character {error.offset} (a product needs its *: 2*s)") from None
    except (ValueError, RecursionError, MemoryError):
        raise _FormulaError("it has too many parts or a null character") from None


def _expression(node: ast.expr, names: Mapping[str, Any], depth: int) -> Any:
    """Convert a node of the syntax tree to a sympy expression."""
    if depth == 0:
        raise _FormulaError(f"it is nested deeper than {_DEEPEST} levels")
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _literal(value)
        case ast.Name(id=name):
            return _named(name, names)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_expression(operand, names, depth - 1)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _expression(operand, names, depth - 1)
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            return _chain(node, _SUMS, names, depth)
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            return _chain(node, _PRODUCTS, names, depth)
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            return _power(_expression(left, names, depth - 1), _expression(right, names, depth - 1))
        case ast.BinOp(op=ast.BitXor()):
            raise _FormulaError("^ is no power, write **")
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
            return _call(name, [_expression(argument, names, depth - 1) for argument in args])
    raise _FormulaError(f"{ast.unparse(node)[:40]!r} is no part of a formula")


def _literal(value: float) -> Any:
    if not abs(value) < 1e308:
        raise _FormulaError("it has a number that a float cannot hold")
    return number(value)


def _named(name: str, names: Mapping[str, Any]) -> Any:
    import sympy

    if name in names:
        return names[name]
    if name in _CONSTANTS:
        return getattr(sympy, name)
    if name in _FUNCTIONS:
        raise _FormulaError(f"{name} needs its argument in brackets")
    known = ", ".join(names)
    raise UnknownNameError(
        f"nothing is known about {name!r}, expected {known}; give parameters={{{name!r}: …}}",
        value=name,
        choices=tuple(names),
    )


def _chain(node: ast.expr, operators: tuple[type[ast.operator], ...], names: Mapping[str, Any], depth: int) -> Any:
    """Parse a + b − c … or a * b / c …, of any length."""
    import sympy

    terms = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, operators):
        terms.append((node.op, _expression(node.right, names, depth - 1)))
        node = node.left
    first = _expression(node, names, depth - 1)
    if operators is _SUMS:
        return sympy.Add(first, *(-term if isinstance(op, ast.Sub) else term for op, term in reversed(terms)))
    if any(isinstance(op, ast.Div) and term.is_zero for op, term in terms):
        raise _FormulaError("it divides by zero")
    return sympy.Mul(first, *(1 / term if isinstance(op, ast.Div) else term for op, term in reversed(terms)))


def _power(base: Any, exponent: Any) -> Any:
    import sympy

    if not (base.free_symbols or exponent.free_symbols):
        value = _value("**", lambda a, b: a**b, [base, exponent])
        bits = max(base.p.bit_length(), base.q.bit_length()) if base.is_Rational else 1
        exact = exponent.is_Rational and bits * max(1, abs(exponent)) <= _EXACT_BITS
        return base**exponent if exact else sympy.Float(value)
    _refuse_high(exponent)
    power = base**exponent
    for part in power.atoms(sympy.Pow):  # powers of powers multiply
        _refuse_high(part.exp)
    return power


def _refuse_high(exponent: Any) -> None:
    """Refuse exponents so high that sympy would not come to an end."""
    if not exponent.free_symbols and abs(_value("the exponent", lambda a: a, [exponent])) > _HIGHEST:
        raise _FormulaError(f"it has a power of more than {_HIGHEST}")


def _call(name: str, arguments: list[Any]) -> Any:
    """Apply a function to its arguments."""
    import sympy

    needed = 2 if name == "atan2" else 1
    if len(arguments) != needed:
        raise _FormulaError(f"{name} has {len(arguments)} arguments, expected {needed}")
    if not any(argument.free_symbols for argument in arguments):
        value = _value(name, _FUNCTIONS[name], arguments)
        if any(argument.has(sympy.Float) for argument in arguments):
            return sympy.Float(value)  # sympy's own knows no underflow
    return getattr(sympy, name)(*arguments)


def _value(name: str, function: Any, arguments: list[Any]) -> float:
    """Return the value of a function of constants, which must be real and fit into a float."""
    try:
        value = function(*map(float, arguments))
    except (ArithmeticError, ValueError, TypeError):
        value = math.nan
    if isinstance(value, complex) or not math.isfinite(value):
        shown = ", ".join(f"{argument}"[:20] for argument in arguments)
        raise _FormulaError(f"{name} of {shown} is not a real number that a float can hold")
    return value
