"""Bridges to JAX, PyTorch and CasADi: values and derivatives there are those of the system. Skipped without them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.bridges.functions import Accelerations, InverseDynamics
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.system.test_derivatives import pushed

pytestmark = pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")


def rigid() -> fm.System:
    """A free body with a quaternion, and a pendulum on it."""
    scene = fm.SceneBuilder("pair", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("hub", mass=2.0, inertia=(0.3, 0.4, 0.5)).rigid_body("arm", mass=0.5, inertia=(0.02, 0.03, 0.04))
    scene.free("flight", "ground", "hub", angular_velocity=(0.3, -0.4, 0.5))
    scene.revolute("pivot", "hub", "arm", parent_position=(0.2, 0.1, 0.0), angle=0.4, rate=1.0)
    return fm.compile(scene.scene())


SYSTEMS = {"quaternion": rigid, "flexible": lambda: pushed(2.0), "closed": lambda: fm.compile(m.four_bar(modes=1))}


def arguments(system: fm.System) -> tuple[Any, Any, Any, float]:
    state = system.initial_state
    return state.q.copy(), state.u.copy(), np.linspace(-0.5, 1.0, system.nu), 0.0


def expected(system: fm.System, kind: str) -> tuple[Any, tuple[Any, ...]]:
    """Value and Jacobians by q, u, the third argument and time."""
    q, u, third, t = arguments(system)
    if kind == "accelerations":
        d = system.acceleration_derivatives(system.state(q, u, t), third)
        return d.accelerations, (d.by_coordinates, d.by_speed, d.by_force, d.by_time)
    other = system.inverse_dynamics_derivatives(system.state(q, u, t), third)
    return other.tau, (other.by_coordinates, other.by_speed, other.by_acceleration, other.by_time)


def close(found: Any, wanted: Any) -> None:
    wanted = np.asarray(wanted)
    size = np.max(np.abs(wanted), initial=1e-300)
    np.testing.assert_allclose(np.asarray(found).reshape(wanted.shape), wanted, rtol=0.0, atol=1e-12 * size)


CASES = pytest.mark.parametrize(("name", "kind"), [
    (name, kind) for name in SYSTEMS for kind in ("accelerations", "inverse_dynamics")
])  # fmt: skip


@CASES
def test_functions_of_many_states(name: str, kind: str) -> None:
    """A state without accelerations has values of NaN, and spoils no other; its derivatives raise."""
    system = SYSTEMS[name]()
    of = Accelerations(system) if kind == "accelerations" else InverseDynamics(system)
    value, parts = expected(system, kind)
    rows = [np.array([x, x, x]) for x in arguments(system)]
    rows[0][1] = np.nan
    found = of.values(*rows)
    with pytest.raises(ValueError) as refused:
        of.jacobians(*rows)
    assert refused.value.__notes__ == ["derivatives were asked for at this state, 1 of 3 counted from 0"]
    jacobians = of.jacobians(*(np.delete(row, 1, axis=0) for row in rows))
    for i in (0, 2):
        close(found[i], value)
        for part, wanted in zip(jacobians, parts, strict=True):
            close(part[i // 2], wanted)
    assert np.isnan(found[1]).all()


@CASES
def test_arguments_of_extended_precision_give_the_same_bits(name: str, kind: str) -> None:
    system = SYSTEMS[name]()
    of = Accelerations(system) if kind == "accelerations" else InverseDynamics(system)
    rows = [np.array([x]) for x in arguments(system)]
    rows[2] = np.random.default_rng(1).standard_normal((20, system.nu))
    rows = [np.repeat(row, 20 // len(row), axis=0) for row in rows]
    longer = [row.astype(np.longdouble) for row in rows]
    for found, wanted in zip(
        (of.values(*longer), *of.jacobians(*longer)), (of.values(*rows), *of.jacobians(*rows)), strict=True
    ):
        assert found.tobytes() == wanted.tobytes()


def test_what_bridges_refuse() -> None:
    from tests.flexmb.system.test_copies import controlled

    with pytest.raises(TypeError, match="a System is needed"):
        Accelerations(rigid().scene)  # type: ignore[arg-type]
    with pytest.raises(NotImplementedError, match="has controllers"):
        Accelerations(fm.compile(controlled()))


@CASES
def test_jax(name: str, kind: str) -> None:
    jax = pytest.importorskip("jax")
    from flexmb.bridges import jax as bridge

    jax.config.update("jax_enable_x64", True)
    system = SYSTEMS[name]()
    f, given = getattr(bridge, kind)(system), arguments(system)
    value, parts = expected(system, kind)
    close(jax.jit(f)(*given), value)
    for route in (jax.jacfwd, jax.jacrev):
        for place, wanted in enumerate(parts):
            close(jax.jit(route(f, argnums=place))(*given), wanted)
    many = [np.array([x, x, x]) for x in given]
    close(jax.vmap(f)(*many), [value] * 3)
    close(jax.vmap(f, in_axes=(0, None, None, None))(many[0], *given[1:]), [value] * 3)
    gradient = jax.grad(lambda q: jax.vmap(f)(q, *many[1:])[1].sum())(many[0])
    close(gradient[1], parts[0].sum(axis=0))
    assert not np.asarray(gradient)[[0, 2]].any()
    close(f(given[0], given[1]), f(*given[:2], 0.0 * given[2], 0.0))


def test_what_the_bridge_to_jax_refuses() -> None:
    jax = pytest.importorskip("jax")
    from flexmb.bridges.jax import accelerations

    jax.config.update("jax_enable_x64", True)
    system = rigid()
    f, (q, u, *_) = accelerations(system), arguments(system)
    with pytest.raises(ValueError, match=r"shape \(3, 8\).*jax.vmap"):
        f(np.array([q, q, q]), u)
    with pytest.raises(TypeError, match="jax_enable_x64"):
        f(q.astype(np.float32), u)
    assert np.isnan(np.asarray(f(0.0 * q, u))).all()  # no orientation


@CASES
def test_torch(name: str, kind: str) -> None:
    torch = pytest.importorskip("torch")
    from flexmb.bridges import torch as bridge

    system = SYSTEMS[name]()
    f, given = getattr(bridge, kind)(system), arguments(system)
    value, parts = expected(system, kind)
    one = [torch.tensor(x, dtype=torch.float64, requires_grad=True) for x in given]
    close(f(*one).detach(), value)
    many = [torch.tensor(np.array([x, x]), dtype=torch.float64, requires_grad=True) for x in given]
    found = f(*many)
    for i in range(system.nu):
        gradients = torch.autograd.grad(found[1, i], many, retain_graph=True)
        for gradient, wanted in zip(gradients, parts, strict=True):
            close(gradient[1], wanted[i])
            assert not gradient[0].any()
    close(f(*one[:2]).detach(), f(*one[:2], 0.0 * one[2], 0.0 * one[3]).detach())
    with pytest.raises(TypeError, match="float64"):
        f(one[0].float(), one[1])
    with pytest.raises(ValueError, match="shape"):
        f(one[0], one[1][:-1])


@CASES
def test_casadi(name: str, kind: str) -> None:
    casadi = pytest.importorskip("casadi")
    from flexmb.bridges import casadi as bridge

    system = SYSTEMS[name]()
    f, given = getattr(bridge, kind)(system), arguments(system)
    value, parts = expected(system, kind)
    close(np.array(f(*given)).ravel(), value)
    symbols = [casadi.MX.sym(f"x{i}", f.size1_in(i)) for i in range(4)]
    out = f(*symbols)
    jacobian = casadi.Function("J", symbols, [casadi.jacobian(out, x) for x in symbols])
    for part, wanted in zip(jacobian(*given), parts, strict=True):
        close(np.array(part), wanted)


def gradient_in(library: str, system: fm.System, q: Any, u: Any) -> Any:
    """Of the first acceleration by the speeds, as the library's users take it."""
    pytest.importorskip(library)
    bridge = import_module(f"flexmb.bridges.{library}")
    f, used = bridge.accelerations(system), import_module(library)
    if library == "jax":
        used.config.update("jax_enable_x64", True)
        return np.asarray(used.grad(lambda u: f(q, u)[0])(u))
    if library == "torch":
        speeds = used.tensor(u, requires_grad=True)
        f(used.tensor(q), speeds)[0].backward()
        return speeds.grad.numpy()
    symbol = used.MX.sym("u", system.nu)
    of_first = used.jacobian(f(q, symbol, np.zeros(system.nu), 0.0)[0], symbol)
    return np.array(used.Function("J", [symbol], [of_first])(u)).ravel()


@pytest.mark.parametrize("library", ["jax", "torch", "casadi"])
def test_derivatives_of_a_refused_state_raise_with_the_words_of_flexmb(library: str) -> None:
    """Not NaN, with which an optimiser would go on; afterwards a right state has the gradient that it had before."""
    system = SYSTEMS["flexible"]()
    q, u, *_ = arguments(system)
    right = gradient_in(library, system, q, u)
    close(right, expected_by_speed(system, q, u))
    spoiled = q.copy()
    spoiled[-1] = np.nan
    for state, said in (((spoiled, u), "give finite numbers"), ((q, u + 1e160), "not finite|infinite|overflow")):
        with pytest.raises(Exception, match=said):
            gradient_in(library, system, *state)
        assert gradient_in(library, system, q, u).tobytes() == right.tobytes()


def expected_by_speed(system: fm.System, q: Any, u: Any) -> Any:
    return system.acceleration_derivatives(system.state(q, u)).by_speed[0]
