"""NumPy's functions accept symbols under whatever name, in whatever place, and in any thread."""

import math
import re
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial, wraps
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pyharness import InputError, Taylor
from pyharness.model.state_torque import recorded

Function = Callable[..., Any]
OMEGA = (0.31, -0.72, 1.43)

# Functions, each with its use in a torque.
USES: dict[str, tuple[Function, Callable[[Function, Any, Any], Any]]] = {
    "where": (np.where, lambda f, t, w: f(w > 0.5, w, -t)),
    "clip": (np.clip, lambda f, t, w: f(w, -0.5, 0.5)),
    "clip of a number": (np.clip, lambda f, t, w: [f(w[1], -0.5, 0.5), 0.0, 0.0]),
    "sign": (np.sign, lambda f, t, w: f(w)),
    "maximum": (np.maximum, lambda f, t, w: f(w, 0.2 * t)),
    "maximum of a list": (np.maximum, lambda f, t, w: f([w[0], t, 0.5], 0.7)),
    "largest": (np.max, lambda f, t, w: [f(w), f([w[0], t]), 0.0]),
    "method": (np.maximum.reduce, lambda f, t, w: [f(w), 0.0, 0.0]),
    "interp": (np.interp, lambda f, t, w: f(w, [0.0, 1.0], [2.0, 5.0])),
    "interp of time": (np.interp, lambda f, t, w: [f(t, [0.0, 1.0], [2.0, 5.0]), 0.0, w[0]]),
    "norm": (np.linalg.norm, lambda f, t, w: -f(w) * w),
    "norm of a list": (np.linalg.norm, lambda f, t, w: -f([w[0], t]) * w),
    "array": (np.array, lambda f, t, w: np.abs(f([w[0], -t, 0.5])) * (f([w[1], t, 1.0]) > 0.0)),
    "zeros": (np.zeros, lambda f, t, w: _filled(f(3), w)),
    "eye": (np.eye, lambda f, t, w: _filled(f(3)[0], w)),
    "sine of math": (math.sin, lambda f, t, w: [f(t), f(w[0]), f(0.5)]),
    "power of math": (math.pow, lambda f, t, w: [f(t, 1.5), f(w[0], 2.0), f(2.0, w[2])]),
}


def _filled(array: Any, w: Any) -> Any:
    array[1] = w[0]
    array += 0.5 * w
    return array


def _of_variable(f: Function, use: Any) -> Function:
    return lambda t, w: use(f, t, w)


def _of_default(f: Function, use: Any) -> Function:
    def torque(t: Any, w: Any, function: Function = f) -> Any:
        return use(function, t, w)

    return torque


def _of_keyword(f: Function, use: Any) -> Function:
    def torque(t: Any, w: Any, *, function: Function = f) -> Any:
        return use(function, t, w)

    return torque


def _of_partial(f: Function, use: Any) -> Function:
    return partial(_of_variable(partial(f), use))


def _of_object(f: Function, use: Any) -> Function:
    class Plant(SimpleNamespace):
        def torque(self, t: Any, w: Any) -> Any:
            return use(self.function, t, w)

    return Plant(function=f).torque


def _of_callable(f: Function, use: Any) -> Function:
    class Plant:
        def __init__(self) -> None:
            self.function = f

        def __call__(self, t: Any, w: Any) -> Any:
            return use(self.function, t, w)

    return Plant()


def _of_decorated(f: Function, use: Any) -> Function:
    def shown(function: Function) -> Function:
        @wraps(function)
        def called(*given: Any) -> Any:
            return function(*given)

        return called

    return shown(_of_variable(f, use))


def _of_module(f: Function, use: Any) -> Function:
    return _defined("def torque(t, w): return use(chosen, t, w)", chosen=f, use=use)


def _of_other_module(f: Function, use: Any) -> Function:
    helper = _defined("def torque(t, w): return use(chosen, t, w)", chosen=f, use=use)
    return _defined("def torque(t, w): return helped(t, w)", helped=helper)


def _defined(text: str, **names: Any) -> Function:
    """Return the function `torque` of a new module with names such as imported ones."""
    module = ModuleType("written")
    vars(module).update(names)
    exec(text, vars(module))
    found: Function = module.torque
    return found


PLACES = [
    _of_variable, _of_default, _of_keyword, _of_partial, _of_object, _of_callable, _of_decorated,
    _of_module, _of_other_module,
]  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", USES)
def test_a_function_under_any_name_is_recorded(name: str, place: Any) -> None:
    function, use = USES[name]
    torque = place(function, use)
    tape = recorded(torque).tape
    if function is math.sin:
        use = USES["sine of math"][1]
        assert tape == recorded(lambda t, w: use(np.sin, t, w)).tape
    wanted = [float(x) for x in np.broadcast_to(torque(1.75, np.array(OMEGA)), 3)]
    assert recorded(torque).at(1.75, OMEGA, (1.0, 0.0, 0.0, 0.0)) == pytest.approx(
        wanted, rel=1e-14
    )


def test_imported_and_qualified_names_have_the_same_tape() -> None:
    names: dict[str, Any] = {}
    exec("from numpy import *\nfrom numpy.linalg import norm as length\nimport numpy as np", names)
    for imported, qualified in (
        ("where(w > t, clip(w, -1, 1), -w)", "np.where(w > t, np.clip(w, -1, 1), -w)"),
        ("length(w) * maximum(w, [0.0, t, 1.0])", "np.linalg.norm(w) * np.maximum(w, [0.0, t, 1])"),
        ("sqrt(array([w[0], t, 2.0]))", "np.sqrt(np.array([w[0], t, 2.0]))"),
    ):
        one, other = (eval(f"lambda t, w: {text}", names) for text in (imported, qualified))
        assert recorded(one) == recorded(other)


def test_two_functions_of_one_factory_have_their_own_names() -> None:
    def made(function: Function) -> Function:
        return lambda x: function(x)

    sine, cosine = made(math.sin), made(math.cos)
    found = recorded(lambda t, w: [sine(w[0]), cosine(w[0]), 0.0])
    assert found == recorded(lambda t, w: [np.sin(w[0]), np.cos(w[0]), 0.0])


def test_other_functions_of_the_user_are_recorded() -> None:
    """Events, right-hand sides and functions of the inertia are recorded in the same way."""
    names: dict[str, Any] = {"clip": np.clip, "sin": math.sin, "zeros": np.zeros}
    exec("def fun(t, y):\n f = zeros(2)\n f[0] = clip(y[1], -1, sin(t))\n return f", names)
    assert Taylor(names["fun"], 0.0, [1.0, 2.0], 1.0).step() is None
    assert names["zeros"] is np.zeros
    assert names["sin"] is math.sin


# The functions of one or two arguments, and those that a message may refuse.
UFUNCS = {
    name: each
    for name, each in vars(np).items()
    if isinstance(each, np.ufunc) and each.nout == 1 and each.nin <= 2 and not each.signature
}


@pytest.mark.parametrize("name", UFUNCS)
def test_a_function_is_computed_as_by_numpy_or_refused_by_its_name(name: str) -> None:
    function = UFUNCS[name]
    rest = [0.45] * (function.nin - 1)

    def torque(t: Any, w: Any) -> Any:
        return [function(w[0], *rest) * 1.0, 0.0, 0.0]

    try:
        found = recorded(torque).at(0.0, OMEGA, (1.0, 0.0, 0.0, 0.0))[0]
    except InputError as error:
        what, _, allowed = str(error).partition("allowed: ")
        assert "can't be recorded" in what or "accepts numbers only" in what
        assert name not in re.findall(r"\w+", allowed)
    else:
        with np.errstate(all="ignore"):
            wanted = float(function(OMEGA[0], *rest))
        assert found == pytest.approx(wanted, rel=1e-14, nan_ok=True)


@pytest.fixture
def often() -> Iterator[None]:
    """Let threads take turns often."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("often")
def test_threads_that_record_one_module_do_not_disturb_each_other() -> None:
    names: dict[str, Any] = {"sin": math.sin, "zeros": np.zeros, "maximum": np.maximum}
    text = "def torque(t, w):\n f = zeros(3)\n f[:] = maximum([w[0], sin(t), 0.1], 0.2)\n return f"
    exec(text, names)
    wanted = recorded(names["torque"])
    found: list[Any] = []
    wrong: list[Any] = []
    is_over = threading.Event()

    def record() -> None:
        try:
            found.extend(recorded(names["torque"]) for _ in range(6))
        except InputError as error:
            wrong.append(error)

    def compute() -> None:
        """Call the functions, which are replaced meanwhile, with numbers."""
        while not is_over.is_set():
            values = names["torque"](0.5, (0.1, 0.2, 0.3))
            if values.dtype != float or values.tolist() != [0.2, math.sin(0.5), 0.2]:
                wrong.append(values)

    beside = threading.Thread(target=compute)
    beside.start()
    threads = [threading.Thread(target=record) for _ in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    is_over.set()
    beside.join()
    assert not wrong
    assert found == [wanted] * 24
    assert (names["sin"], names["zeros"], names["maximum"]) == (math.sin, np.zeros, np.maximum)
    assert all(not hasattr(each, "original") for each in vars(np).values())


def test_a_refused_function_is_left_as_it_was() -> None:
    def torque(t: Any, w: Any, *, sine: Function = math.sin) -> Any:
        return [sine(t), float(w[0]), 0.0]

    with pytest.raises(InputError, match="a conversion"):
        recorded(torque)
    assert torque.__kwdefaults__ == {"sine": math.sin}
