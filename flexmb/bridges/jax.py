"""Systems in JAX: functions that `jax.jit`, `jax.vmap`, `jax.grad`, `jax.jvp` and `jax.vjp` accept.

    import jax
    from flexmb.bridges.jax import accelerations
    jax.config.update("jax_enable_x64", True)
    f = accelerations(system)                     udot = f(q, u, forces, t)
    jax.grad(lambda u: f(q, u)[0])(u)             exact

The equations are evaluated by flexmb on the processor, behind a callback of the host; states that `vmap` gathers are
evaluated in one call. Derivatives are exact, forward and reverse; those of second order are not to be had.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexmb.bridges.functions import Accelerations, Function, InverseDynamics
from flexmb.system.system import System

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:  # pragma: no cover
    raise ImportError("JAX is missing: pip install jax") from error


def accelerations(system: System) -> Callable[..., jax.Array]:
    """`f(q, u, forces=0, t=0)`: udot (nu,) of q (nq,), u (nu,), further generalised forces (nu,) and the time (s).

    NaN where there are no accelerations; derivatives there raise an error. TypeError for numbers that have not 64 bits,
    ValueError for shapes that do not fit, NotImplementedError for scenes with controllers.
    """
    return _bridged(Accelerations(system))


def inverse_dynamics(system: System) -> Callable[..., jax.Array]:
    """`f(q, u, accelerations=0, t=0)`: tau (nu,), the forces along the speeds that these accelerations need."""
    return _bridged(InverseDynamics(system))


def _bridged(of: Function) -> Callable[..., jax.Array]:
    nu = of.system.nu

    def result(*shape: int) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(shape, jnp.float64)

    @jax.custom_jvp
    def function(*arguments: jax.Array) -> jax.Array:
        at_host = _many(of.values, of)
        values: jax.Array = jax.pure_callback(at_host, result(nu), *arguments, vmap_method="broadcast_all")
        return values

    @function.defjvp
    def _(arguments: Any, directions: Any) -> Any:
        # The Jacobians come from the host, their products with directions are JAX's: so it can also transpose them.
        shapes = tuple(result(nu, *shape) for shape in of.shapes)
        parts = jax.pure_callback(_many(of.jacobians, of), shapes, *arguments, vmap_method="broadcast_all")
        return function(*arguments), sum(
            part @ along if along.ndim else part * along for part, along in zip(parts, directions, strict=True)
        )

    def called(q: Any, u: Any, third: Any = None, t: Any = 0.0) -> jax.Array:
        third = np.zeros(nu) if third is None else third
        return function(*(_checked(x, shape) for x, shape in zip((q, u, third, t), of.shapes, strict=True)))

    return called


def _many(at_host: Callable[..., Any], of: Function) -> Callable[..., Any]:
    """The function of arguments with any number of leading axes, which `vmap` makes."""

    def flat(*arguments: Any) -> Any:
        given = [np.asarray(x, float) for x in arguments]
        leading = given[0].shape[:-1]
        rows = [np.ascontiguousarray(x).reshape(-1, *shape) for x, shape in zip(given, of.shapes, strict=True)]
        values = at_host(*rows)
        if isinstance(values, tuple):
            return tuple(part.reshape(*leading, *part.shape[1:]) for part in values)
        return values.reshape(*leading, values.shape[-1])

    return flat


def _checked(x: Any, shape: tuple[int, ...]) -> jax.Array:
    array = jnp.asarray(x, None if hasattr(x, "dtype") else float)
    if array.dtype != jnp.float64:
        raise TypeError(
            f"an argument of type {array.dtype}: flexmb computes with 64 bits; call "
            'jax.config.update("jax_enable_x64", True) first, and give floats'
        )
    if array.shape != shape:
        raise ValueError(f"an argument has the shape {array.shape} instead of {shape}; take jax.vmap for many states")
    return array
