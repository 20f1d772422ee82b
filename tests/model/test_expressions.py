"""Torques as text: their values, and that no text raises another exception than InputError."""

import math
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyharness import InputError, Scene, StateTorque, TorqueLaw
from pyharness.model.expressions import FUNCTIONS, INPUTS, parsed
from tests.tables import tables

VALUES = tables(__file__)["values"]
CONSTANTS = {"k": 0.25, "wheel": 3, "_unused": -1.5}


def _torque(text: str, **constants: Any) -> StateTorque | TorqueLaw:
    return parsed(["0", text, "0"], constants)


def _value(torque: StateTorque | TorqueLaw, state: list[float]) -> float:
    if isinstance(torque, TorqueLaw):
        return torque.at(state[0])[1]
    return torque.at(state[0], state[1:4], state[4:])[1]


def _in_python(text: str, state: list[float], constants: dict[str, float]) -> Any:
    names: dict[str, Any] = {
        "abs": abs, "min": min, "max": max, "clip": lambda x, low, high: min(max(x, low), high),
        "sign": lambda x: 1.0 if x > 0.0 else -1.0, "heaviside": lambda x: float(x > 0.0),
        "where": lambda condition, x, y: x if condition else y, "cbrt": lambda x: x ** (1.0 / 3.0),
        "pi": math.pi,
    } | constants  # fmt: skip
    names |= {name: getattr(math, name) for name in FUNCTIONS if name not in names}
    names |= dict(zip(INPUTS, state, strict=True))
    return eval(" ".join(text.split()), {"__builtins__": {}}, names)


@pytest.mark.parametrize("text", VALUES)
def test_value_is_that_of_the_same_text_in_python(text: str) -> None:
    torque = _torque(text, **CONSTANTS)
    source = random.Random(f"expressions {text}")
    for _ in range(20):
        state = [source.uniform(0.5, 1.5) for _ in INPUTS]
        wanted = _in_python(text, state, CONSTANTS)
        assert _value(torque, state) == pytest.approx(wanted, rel=1e-13, abs=1e-14)


def _drawn(source: random.Random, depth: int) -> str:
    """Return a random expression whose value, and the values of whose parts, are bounded."""
    if depth == 0:
        return source.choice([*INPUTS, "pi", "k", f"{source.uniform(-2.0, 2.0)!r}"])
    a, b = (_drawn(source, source.randrange(depth)) for _ in range(2))
    return source.choice([
        f"{a} + {b}", f"({a} - {b})", f"({a})*({b})", f"({a})/(2 + cos({b}))", f"-({a})**2",
        f"sqrt(1 + ({a})**2)", f"exp(sin({a}))", f"tanh({a})", f"cos({a})", f"sin(1*({a}) - {b})",
    ])  # fmt: skip


def test_values_of_random_expressions_are_those_of_python() -> None:
    source = random.Random("random expressions")
    for _ in range(300):
        text = _drawn(source, 6)
        torque = parsed([text, text, "0"], {"k": 0.25})
        state = [source.uniform(-1.0, 1.0) for _ in INPUTS]
        wanted = _in_python(text, state, {"k": 0.25})
        assert _value(torque, state) == pytest.approx(wanted, rel=1e-10, abs=1e-10), text


def test_value_is_that_of_many_digits() -> None:
    mpmath = pytest.importorskip("mpmath")
    torque = _torque("exp(-k*t)*tanh(w1)/sqrt(1 + q2**2) - w2*cosh(0.3*w3)", k=0.7)
    state = [1.25, 0.5, -0.75, 2.0, 0.5, 0.5, -0.5, 0.5]
    with mpmath.workdps(40):
        t, w1, w2, w3, _, _, q2, _ = map(mpmath.mpf, state)
        damped = mpmath.exp(-mpmath.mpf(0.7) * t) * mpmath.tanh(w1) / mpmath.sqrt(1 + q2**2)
        wanted = damped - w2 * mpmath.cosh(mpmath.mpf(0.3) * w3)
        assert abs(_value(torque, state) - wanted) < 4e-16 * abs(wanted)


def test_expression_of_time_alone_is_a_law_if_it_has_the_form_of_one() -> None:
    found = parsed(["1 + 2*t", "3*sin(w*t)", "cos(t)/4 - 0*w1"], {"w": 0.5})
    assert found == TorqueLaw((1, 0, 0), (2, 0, 0), [((0, 3, 0), 0.5)], [((0, 0, 0.25), 1.0)])
    assert parsed(["0", "w1 - w1", "sqrt(4) - 2"], {}) == TorqueLaw()
    for text in ("sin(t)**2", "t*t", "sin(t + 1)", "exp(t)"):
        assert isinstance(_torque(text), StateTorque)


def test_sine_of_a_multiple_of_a_sine_is_no_law() -> None:
    torque = _torque("sin(2*sin(t))")
    assert _value(torque, [0.75] + [0.0] * 7) == pytest.approx(math.sin(2 * math.sin(0.75)))


def test_torque_has_its_expressions_and_constants() -> None:
    found = parsed(("-k * w1", " 0\n", "q0*\n wheel"), {"k": 1, "wheel": np.float64(2.5)})
    assert isinstance(found, StateTorque)
    assert found.expression == ("-k * w1", "0", "q0* wheel")
    assert found.constants == (("k", 1.0), ("wheel", 2.5))
    assert found.needs_attitude
    assert found == parsed(found.expression, dict(found.constants))
    assert hash(found) == hash(parsed(found.expression, dict(found.constants)))
    assert found != parsed(found.expression, {"k": 1.0, "wheel": 2.0})
    assert Scene("a", (1, 2, 3), moments=(1, 2, 3), torque=found).torque is found
    assert repr(found) == (
        "StateTorque(['-k * w1', '0', 'q0* wheel'], {'k': 1.0, 'wheel': 2.5}, 0 operations, "
        "needs_attitude=True)"
    )


def test_repr_of_a_long_torque_is_short() -> None:
    text = " + ".join(f"sin({n}*w1)" for n in range(400))
    found = repr(parsed([text, text, text], {"k" * 200: 1.0}))
    assert "operations" in found
    assert len(found) < 300
    assert "\n" not in found


def test_same_depth_is_allowed_from_a_deep_stack() -> None:
    text = "+".join(["w1"] * 490)

    def below(depth: int) -> StateTorque | TorqueLaw:
        return below(depth - 1) if depth else _torque(text)

    assert _value(below(300), [0.0, 2.0, *[0.0] * 6]) == 980.0


def test_parentheses_are_limited_as_the_message_says() -> None:
    """Regression test: the message called 201 parentheses no arithmetic expression."""
    nested = "sin({})".format
    text = "w1"
    for _ in range(200):
        text = nested(text)
    assert _torque(text)
    for deep in (nested(text), "(" * 201):
        with pytest.raises(InputError, match="nested too deeply; allowed: at most 200 parenthes"):
            _torque(deep)


def _is_torque_or_one_line(text: str) -> None:
    try:
        found = parsed([text, "0", "0"], {"k": 0.5})
    except InputError as error:
        lines = str(error)
    else:
        assert isinstance(found, (StateTorque, TorqueLaw))
        lines = repr(found)
    assert len(lines.splitlines()) == 1


_PIECES = (
    *INPUTS, *FUNCTIONS, "pi", "k", "+", "-", "*", "/", "**", "//", "(", ")", ",", ".", " ", "\n",
    "_", "0", "1", "2", "9", "1e9", "1e308", "1e-308", "0x", "0b", "0o", "1j", "if", "else", "for",
    "in", "is", "not", "or", "and", "await", "yield", "lambda", ":", "=", "[", "]", "'", '"', "\0",
    "sqrt(", "exp(", "**-", "e", "E",
)  # fmt: skip


@pytest.mark.campaign
@settings(max_examples=300, deadline=2000, derandomize=True, database=None)
@given(st.text(max_size=200))
def test_any_text_is_a_torque_or_one_line(text: str) -> None:
    _is_torque_or_one_line(text)


@pytest.mark.campaign
@settings(max_examples=1500, deadline=2000, derandomize=True, database=None)
@given(st.lists(st.sampled_from(_PIECES), max_size=40).map("".join))
def test_any_sequence_of_words_is_a_torque_or_one_line(text: str) -> None:
    _is_torque_or_one_line(text)


@settings(max_examples=300, deadline=2000, derandomize=True, database=None)
@given(
    st.recursive(
        st.sampled_from(["t", "w1", "q0", "k", "0", "1e200", "1e-200", "3", "0.5", "-1"]),
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner).map(
                lambda each: f"({''.join(each)})"
            ),
            st.tuples(st.sampled_from(FUNCTIONS), inner).map(lambda each: f"{each[0]}({each[1]})"),
        ),
        max_leaves=30,
    )
)
def test_any_arithmetic_is_a_torque_or_one_line(text: str) -> None:
    _is_torque_or_one_line(text)


def test_names_are_time_omega_and_the_attitude_with_the_scalar_first() -> None:
    torque = parsed(["t + 10*w1 + 100*w2 + 1000*w3", "q0 + 10*q1 + 100*q2 + 1000*q3", "0"], {})
    assert isinstance(torque, StateTorque)
    assert torque.at(1.0, (2.0, 3.0, 4.0), (5.0, 6.0, 7.0, 8.0)) == (4321.0, 8765.0, 0.0)


def test_powers_of_small_quotients_do_not_underflow() -> None:
    for text in ("(w3/1e12)**30", "1/(w3/1e12)**30", "(1e-12*w3)**40*(1e-12*w3)"):
        torque = parsed(["0", "0", text], {})
        assert isinstance(torque, StateTorque)
        found = torque.at(0.0, (0.0, 0.0, 1e12), (1.0, 0.0, 0.0, 0.0))
        assert found[2] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("text", [
    "(w3 + 1e200)*1e-170*1e-170", "w3/1e250/1e90", "1e-200*(w1/1e140 - w3/1e140)",
    "1e-170*w2*1e-170*(1e-10*w1)", "1e300*(1e-170*w2*1e-170)", "sin(1e-170*w2*1e-170*1e100)",
])  # fmt: skip
def test_coefficients_that_would_underflow_are_not_folded(text: str) -> None:
    """The product of two numbers is 0 or subnormal, but not their products with an omega."""
    omega = (3e200, 1e200, 5e200)
    torque = parsed([text, "0", "0"], {})
    assert isinstance(torque, StateTorque)
    wanted = eval(text, {"sin": math.sin}, dict(zip(("w1", "w2", "w3"), omega, strict=True)))
    assert wanted
    assert torque.at(0.0, omega, (1.0, 0.0, 0.0, 0.0))[0] == pytest.approx(wanted, rel=1e-12)
    # Turned by a third of a turn about (1, 1, 1), the torque is recorded anew.
    axes = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    turned = torque.rotated(axes).at(0.0, tuple(axes.T @ omega), (1.0, 0.0, 0.0, 0.0))
    assert sum(turned) == pytest.approx(wanted, rel=1e-12)
