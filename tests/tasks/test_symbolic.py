"""Paths written as formulas: exact derivatives, one compiled function, and texts that are never run."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import Circle, ExtendedMotionPlan, InputError, TaskError, UnknownNameError, check_task, simulate
from pathcontrol.tasks.symbolic.symbolic_path import SymbolicPath

S = np.linspace(-2.0, 2.0, 41)
s = sympy.Symbol("s")
#: what the texts below mean to NumPy, for complex numbers too
NUMPY = {name: getattr(np, name) for name in ("sin", "cos", "exp", "tanh", "sqrt", "pi")} | {"atan": np.arctan}

LEAVES = st.sampled_from(["s", "s", "s", "a", "0.5", "2", "pi/3", "1e-1"])


def grown(parts):
    pair = st.tuples(parts, parts)
    return st.one_of(
        *(pair.map(lambda p, form=form: form.format(*p)) for form in ("({} + {})", "({} - {})", "({})*({})")),
        *(parts.map(lambda p, form=form: form.format(p)) for form in ("sin({})", "cos({})", "tanh({})", "-({})")),
        *(parts.map(lambda p, form=form: form.format(p)) for form in ("exp(-cos({}))", "(sin({}))**3", "atan({})")),
        pair.map(lambda p: "({})/(2 + sin({}))".format(*p)),
        parts.map(lambda p: f"sqrt(2 + cos({p}))"),
    )


TEXTS = st.recursive(LEAVES, grown, max_leaves=8)


def meaning(text, at, a):
    """The value of a text by NumPy, which knows nothing of sympy."""
    return eval(text, {"__builtins__": {}}, NUMPY | {"s": at, "a": a}) + 0 * at


@settings(max_examples=6)  # each is differentiated twice and compiled
@given(TEXTS, TEXTS, floats(-2, 2))
def test_texts_mean_what_they_say_and_derivatives_are_exact(first, second, a):
    path = SymbolicPath([first, second, "s"], 1.0, s0=-2, s_end=2, parameters={"a": a})
    h = 1e-30
    for i, text in enumerate((first, second)):
        value = meaning(text, S, a)
        assert np.allclose(path.q_d(S)[:, i], value, rtol=1e-12, atol=1e-12)
        # the complex step has no difference to lose digits in
        slope = meaning(text, S + 1j * h, a).imag / h
        assert np.allclose(path.dq_d(S)[:, i], slope, rtol=1e-11, atol=1e-11 * (1 + np.abs(slope).max()))
    h = 1e-5
    difference = (path.dq_d(S + h) - path.dq_d(S - h)) / (2 * h)
    assert np.allclose(path.ddq_d(S), difference, rtol=1e-5, atol=1e-5 * (1 + np.abs(difference).max()))


@settings(max_examples=10)
@given(TEXTS, floats(0.5, 2))
def test_a_profile_has_its_exact_derivative_too(text, a):
    path = SymbolicPath(["s", "cos(s)"], theta=f"exp(sin({text}))", s0=-2, s_end=2, parameters={"a": a})
    assert np.allclose(path.theta(S), np.exp(np.sin(meaning(text, S, a))), rtol=1e-12)
    slope = np.exp(np.sin(meaning(text, S + 1e-30j, a))).imag / 1e-30
    assert np.allclose(path.dtheta(S), slope, rtol=1e-10, atol=1e-10 * (1 + np.abs(slope).max()))
    check_task(path, 2)


@settings(max_examples=15)  # of one formula, whose numbers alone differ
@given(st.booleans(), floats(0.2, 2), floats(0.1, 3))
def test_it_is_the_circle_of_the_library(clockwise, radius, speed):
    sign = -1 if clockwise else 1
    path = SymbolicPath(
        ["c + r*cos(s)", f"{sign}*r*sin(s)"], speed, period=2 * sympy.pi, parameters={"r": radius, "c": 0.3}
    )
    circle = Circle(radius, speed, center=[0.3, 0.0], clockwise=clockwise)
    for got, want in zip(path.at(S), circle.at(S), strict=True):
        assert np.allclose(got, want, rtol=1e-13, atol=1e-13)
    q = circle.q_d(S) + 0.1
    assert np.allclose(path.sigma_bar(q), circle.sigma_bar(q), atol=1e-9)
    check_task(path, 2)


@pytest.mark.parametrize("rate", [{"speed": 0.7}, {"theta": "1 + s**2"}, {"theta": 2}])
@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_every_batch_shape_and_constants(shape, rate):
    path = SymbolicPath([0.5, "sin(s)", s, sympy.pi], **rate, s_end=5)
    at = np.linspace(0, 5, int(np.prod(shape))).reshape(shape)
    point = path.at(at)
    assert [a.shape for a in point] == [(*shape, 4)] * 3 + [shape] * 2
    for got, want in zip(point, (path.q_d, path.dq_d, path.ddq_d, path.theta, path.dtheta), strict=True):
        assert np.allclose(got, want(at), rtol=1e-14, atol=1e-14)
    assert np.array_equal(path.q_d(at)[..., [0, 3]], np.broadcast_to([0.5, np.pi], (*shape, 2)))


def test_symbols_are_told_apart_by_their_names():
    r, positive = sympy.Symbol("r", real=True), sympy.Symbol("s", positive=True)
    mixed = SymbolicPath([r * sympy.cos(s), r * sympy.sin(positive)], 1.0, period=2 * np.pi, parameters={r: 0.5})
    plain = SymbolicPath(["r*cos(x)", "r*sin(x)"], 1.0, s="x", period=2 * np.pi, parameters={"r": 0.5})
    assert np.array_equal(mixed.q_d(S), plain.q_d(S))
    # s is real, so that this is smooth
    assert np.allclose(SymbolicPath([sympy.re(s), "s"], 1.0).dq_d(S), 1.0)


def test_parameters_that_are_whole_make_powers_that_are_smooth():
    path = SymbolicPath(["s**k", "s"], 1.0, s0=-1, s_end=1, parameters={"k": 2.0})
    assert np.array_equal(path.at(np.zeros(1)).ddq_d, [[2.0, 0.0]])
    check_task(path, 2)


def test_it_is_pickled_and_compiled_anew():
    path = SymbolicPath(["cos(a*s)", "sin(s)"], theta="2 + cos(s)", period=2 * np.pi, parameters={"a": 2})
    path.at(S)
    again = pickle.loads(pickle.dumps(path))
    assert all(np.array_equal(a, b) for a, b in zip(path.at(S), again.at(S), strict=True))
    assert again.describe() == path.describe()
    assert again.latex() == path.latex()


def test_a_report_has_its_formulas():
    path = SymbolicPath(["r*cos(omega*s)", "s/2"], 0.5, s_end=1, parameters={"r": 0.7, "omega": 3})
    latex = path.latex()
    assert r"r \cos{\left(\omega s \right)}" in latex
    assert r"\vartheta(s) = \frac{0.5}{\lVert q_d'(s) \rVert}" in latex
    assert path.describe()["formulas"] == {"q_d[0]": "r*cos(omega*s)", "q_d[1]": "s/2"}
    assert path.describe()["parameters"] == {"r": 0.7, "omega": 3.0}
    assert r"\vartheta(u) = u^{2} + 1" in SymbolicPath(["u"], theta="1 + u**2", s="u", s_end=1).latex()


def test_an_arm_follows_it(ideal_arm):
    path = SymbolicPath(["0.6*cos(s)", "0.6*sin(2*s)"], theta="1 + cos(s)/2", period=2 * np.pi)
    law = ExtendedMotionPlan(ideal_arm, path, 800.0, [45.0, 100.0], 20.0)
    run = simulate(law, path.q_d(np.array(0.0)), duration=1.5, progress=False)
    assert run.norm("e_p")[0, run.time > 1].max() < 1e-3


@pytest.mark.parametrize(
    "text",
    [
        "__import__('pathlib').Path('canary').touch()",
        "s.__class__.__base__.__subclasses__()",
        "().__class__",
        "lambda: s",
        "[s for s in (1, 2)]",
        "{s}",
        "s if s else 0",
        "(canary := s)",
        "f'{s}'",
        "eval('1')",
        "s[0]",
        "s < 1",
        "s and 1",
        "not s",
        "~s",
        "sin(*s)",
        "sin(x=s)",
        "'s'",
        "True",
        "None",
        "...",
        "1j*s",
        "s; s",
        "s\ns",
        "s\0",
        "",
        "2s",
        "s^2",
        "sin",
        "sin(s, s)",
        "atan2(s)",
        "factorial(9)",
    ],
)
def test_a_text_is_read_and_never_run(text, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="is not understood") as error:
        SymbolicPath([text, "s"], 1.0, s_end=1)
    assert "q_d[0]" in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9**9",
        "9.0**9.0**9.0**9.0",
        "exp(exp(exp(1000)))",
        "exp(exp(exp(a)))",
        "exp(s - s + 1000)",
        "sqrt(-1)",
        "(-8)**(1/3)",
        "1/0",
        "1/(s - s)",
        "0**-1",
        "log(0)",
        "(-1/3)**s",
        "s**1e300",
        "((s**50)**50)**50",
        "1e999",
        "10**400",
        "9" * 400,
        "9" * 2999,
        "s" + "+s" * 2000,
        "(" * 900 + "s" + ")" * 900,
        "sin(" * 40 + "s" + ")" * 40,
        "-" * 2900 + "s",
        "*".join(f"sin({i}*s)" for i in range(1, 60)),
        "(" * 30 + "s" + "*sin(s))**s" * 30,
        "sinh((cosh(tan(atan2(a,0)))**atan2(atan2(2,3),log(((1/3)**1e-300)))))",
    ],
)
def test_constants_that_no_float_holds_and_endless_work_are_refused(text):
    with pytest.raises(InputError):
        SymbolicPath([text, "s"], 1.0, s_end=1, parameters={"a": 1000})


@given(st.text("s01a29.+-*/()^, _=:[]'\"\\\nesinxpqrt", max_size=30))
@settings(max_examples=300)
def test_any_text_is_a_formula_or_refused(text):
    try:
        path = SymbolicPath([text, "s"], 1.0, s_end=1, parameters={"a": 2})
    except (InputError, UnknownNameError):
        return
    assert path.ddq_d(S).shape == (len(S), 2)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("(1 + 10**-300)**(10**300)", 1.0),
        ("sqrt(1000000007*1000000009*998244353)", 1000000007**0.5 * 1000000009**0.5 * 998244353**0.5),
        ("2**100/3**50", 2.0**100 / 3.0**50),
        ("10**-400", 0.0),
        ("1 - 2 - 3*4/6*2", -5.0),
        ("-2**2", -4.0),
        ("2**3**2", 512.0),
        ("sqrt(1/3)**(7919**10)", 0.0),
        ("exp(-1e300)", 0.0),
        ("+atan2(1, -1)", 3 * np.pi / 4),
        (" ( E ) ", np.e),
    ],
)
def test_constants(text, value):
    path = SymbolicPath([text, "s"], 1.0, s_end=1)
    assert np.allclose(path.q_d(S)[:, 0], value, rtol=1e-14)


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: SymbolicPath(["x*s"], 1.0), UnknownNameError, ["q_d[0] = 'x*s'", "'x'", "parameters"]),
        (lambda: SymbolicPath([s * sympy.Symbol("x")], 1.0), UnknownNameError, ["'x'", "expected s", "s='x'"]),
        (lambda: SymbolicPath([sympy.Abs(s)], 1.0), InputError, ["Abs(s)", "twice continuously", "FunctionPath"]),
        (lambda: SymbolicPath(["sqrt(s**2)"], 1.0), InputError, ["Abs(s)", "twice continuously"]),
        (lambda: SymbolicPath([sympy.Piecewise((s, s > 0), (0, True))], 1.0), InputError, ["Piecewise"]),
        (lambda: SymbolicPath([sympy.Max(s, 1)], 1.0), InputError, ["Max(1, s)"]),
        (lambda: SymbolicPath([sympy.Function("f")(s)], 1.0), InputError, ["Derivative(f(s), s)"]),
        (lambda: SymbolicPath([sympy.I * s], 1.0), InputError, ["I*s", "real"]),
        (lambda: SymbolicPath(["s"], theta="1 + sqrt(s**2)"), InputError, ["theta", "Abs(s)"]),
        (lambda: SymbolicPath("s", 1.0), InputError, ["q_d = 's'", "a list"]),
        (lambda: SymbolicPath([], 1.0), InputError, ["one for each joint"]),
        (lambda: SymbolicPath([None], 1.0), InputError, ["q_d[0]"]),
        (lambda: SymbolicPath(["s"]), InputError, ["neither speed nor theta"]),
        (lambda: SymbolicPath(["s"], 1.0, theta=1.0), InputError, ["speed and theta are both"]),
        (lambda: SymbolicPath(["s"], -1.0), InputError, ["speed = -1"]),
        (lambda: SymbolicPath(["s"], 1.0, s_end=-1), InputError, ["s_end = -1", "s_end > s0"]),
        (lambda: SymbolicPath(["s"], 1.0, s_end=1, period=1), InputError, ["period = 1 and s_end = 1", "expected one"]),
        (lambda: SymbolicPath(["s"], 1.0, period=0), InputError, ["period = 0"]),
        (lambda: SymbolicPath(["s"], 1.0, s="sin"), InputError, ["'sin'", "no name for a symbol"]),
        (lambda: SymbolicPath(["s"], 1.0, s="a b"), InputError, ["'a b'"]),
        (lambda: SymbolicPath(["s"], 1.0, parameters={"s": 1}), InputError, ["'s' is the path parameter"]),
        (lambda: SymbolicPath(["a*s"], 1.0, parameters={"a": np.nan}), InputError, ["parameters['a']", "nan"]),
    ],
)
def test_bad_arguments(make, kind, words):
    with pytest.raises(kind) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


@pytest.mark.parametrize("text", ["log(s - 2)", "1/s", "1e300*1e300*s", "sin(s)/s", "acosh(s)"])
def test_what_is_not_finite_is_found_by_the_check(text):
    with pytest.raises(TaskError, match="finite"):
        check_task(SymbolicPath([text, "s"], 1.0, s_end=1), 2)
