"""What kernels read of Python's objects is where they look for it, and a process where it is not is known."""

import ctypes

import numpy as np
import pytest

from flexmb.jit import objects
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import at_address
from flexmb.jit.hooks import HOOKS
from flexmb.jit.kernel import kernel
from flexmb.jit.pointer import STATUS


@bundle
class Results:
    python: np.ndarray
    objects: np.ndarray  # (1,) the function that is called for arguments that cannot be read
    numbers: np.ndarray  # (4,) sum of the last array, its length, the last float


results_at = at_address(Results(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)))


@kernel
def summed(place, arguments, count, names):
    g = results_at(objects.bundle_of(place))
    if count == 2 and names == 0:
        x, a = objects.word_at(arguments, 0), objects.word_at(arguments, 1)
        if objects.is_float(g.python, x) and objects.is_vector(g.python, a):
            values = objects.vector(a)
            total = 0.0
            for i in range(values.shape[0]):
                total += values[i]
            g.numbers[0] = total
            g.numbers[1] = values.shape[0]
            g.numbers[2] = objects.value(x)
            return objects.taken(g.python, x)
    return objects.called(g.python, g.objects[0], arguments, count, names)


def reader(instead) -> tuple:
    results = Results(objects.interpreter(), np.array([id(instead)], np.int64), np.zeros(4))
    signature = STATUS(*[STATUS] * 4)
    summed.compile(signature.args)
    return objects.builtin(HOOKS.address(summed, signature), results, instead), results


def test_objects_of_this_process_can_be_read():
    assert objects.readable()


@pytest.mark.parametrize("name", ["_TYPE", "_VALUE", "_DATA", "_DIMENSIONS", "_SHAPE", "_ELEMENTS", "_FLAGS"])
def test_words_in_other_places_are_known(monkeypatch, name):
    """Negative control: of an interpreter, or a numpy, whose objects are others."""
    monkeypatch.setattr(objects, name, getattr(objects, name) - 1)
    assert not objects.readable.__wrapped__()


def test_floats_and_arrays_are_read():
    call, results = reader(lambda *args, **named: (args, named))
    x = 2.5
    assert call(x, np.arange(7.0)) is x
    np.testing.assert_array_equal(results.numbers[:3], [21.0, 7.0, 2.5])
    assert call(x, np.zeros(0)) is x and results.numbers[1] == 0.0


def test_anything_else_goes_to_python_as_it_came():
    call, _ = reader(lambda *args, **named: (args, named))
    strided, whole = np.arange(8.0)[::2], np.arange(3)
    for args, named in [
        ((), {}), ((1.0,), {}), ((1.0, strided), {}), ((1.0, whole), {}), ((1, np.zeros(2)), {}), ((None, None), {}),
        ((1.0, np.zeros((2, 2))), {}), ((1.0,), {"a": np.zeros(2)}), ((), {"x": 1.0}), ((1.0, np.zeros(2), 3), {}),
    ]:  # fmt: skip
        found = call(*args, **named)
        assert all(a is b for a, b in zip(found[0], args, strict=True)) and found[1].keys() == named.keys()


def test_errors_of_python_arrive():
    def refuse(*args):
        raise KeyError("nothing for you")

    call, _ = reader(refuse)
    with pytest.raises(KeyError, match="nothing for you"):
        call(1)
    assert call.__self__.held[1][0] is refuse
    assert ctypes.sizeof(ctypes.c_void_p) == 8  # words are what is read
