"""Systems in CasADi: functions of one state with exact Jacobians, for its solvers of optimisation problems.

    from flexmb.bridges.casadi import inverse_dynamics
    f = inverse_dynamics(system)                  tau = f(q, u, accelerations, t)

CasADi calls back to Python at every evaluation; keep the object as long as expressions use it. Derivatives of second
order are not to be had: ask solvers for an approximate Hessian, such as Ipopt's "limited-memory".
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.bridges.functions import Accelerations, Function, InverseDynamics
from flexmb.system.system import System

try:
    import casadi
except ImportError as error:  # pragma: no cover
    raise ImportError("CasADi is missing: pip install casadi") from error


def accelerations(system: System) -> casadi.Callback:
    """`f(q, u, forces, t)`: udot (nu,) of q (nq,), u (nu,), further generalised forces (nu,) and the time (s).

    NaN where there are no accelerations; derivatives there raise an error. NotImplementedError for scenes with
    controllers.
    """
    return _Bridged("accelerations", Accelerations(system), ("q", "u", "forces", "t"), "udot")


def inverse_dynamics(system: System) -> casadi.Callback:
    """`f(q, u, accelerations, t)`: tau (nu,), the forces along the speeds that these accelerations need."""
    return _Bridged("inverse_dynamics", InverseDynamics(system), ("q", "u", "accelerations", "t"), "tau")


class _Bridged(casadi.Callback):
    """A function with dense arguments and one dense result."""

    def __init__(self, name: str, of: Function, inputs: tuple[str, ...], output: str) -> None:
        super().__init__()
        self._of, self._inputs, self._output = of, inputs, output
        self._jacobian: Any = None
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return self._inputs[i]

    def get_name_out(self, i: int) -> str:
        return self._output

    def get_sparsity_in(self, i: int) -> Any:
        return casadi.Sparsity.dense(_size(self._of.shapes[i]), 1)

    def get_sparsity_out(self, i: int) -> Any:
        return casadi.Sparsity.dense(self._of.system.nu, 1)

    def eval(self, arguments: Any) -> list[Any]:
        return [casadi.DM(self._of.values(*_rows(self._of, arguments))[0])]

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> Any:
        self._jacobian = _Jacobian(name, self._of, inputs, outputs, options)  # kept, because CasADi does not
        return self._jacobian


class _Jacobian(casadi.Callback):
    """Its derivatives by each argument; the last argument is the function's result, which is not needed."""

    def __init__(self, name: str, of: Function, inputs: Any, outputs: Any, options: Any) -> None:
        super().__init__()
        self._of, self._inputs, self._outputs = of, inputs, outputs
        self.construct(name, options)

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_name_in(self, i: int) -> str:
        return str(self._inputs[i])

    def get_name_out(self, i: int) -> str:
        return str(self._outputs[i])

    def get_sparsity_in(self, i: int) -> Any:
        if i < len(self._of.shapes):
            return casadi.Sparsity.dense(_size(self._of.shapes[i]), 1)
        return casadi.Sparsity(self._of.system.nu, 1)

    def get_sparsity_out(self, i: int) -> Any:
        return casadi.Sparsity.dense(self._of.system.nu, _size(self._of.shapes[i]))

    def eval(self, arguments: Any) -> list[Any]:
        parts = self._of.jacobians(*_rows(self._of, arguments[: len(self._of.shapes)]))
        return [casadi.DM(part[0].reshape(self._of.system.nu, -1)) for part in parts]


def _size(shape: tuple[int, ...]) -> int:
    return shape[0] if shape else 1


def _rows(of: Function, arguments: Any) -> list[Any]:
    """One state as arrays of n = 1 states."""
    return [np.array(x.full(), float).reshape(1, *shape) for x, shape in zip(arguments, of.shapes, strict=True)]
