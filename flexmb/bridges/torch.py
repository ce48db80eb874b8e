"""Systems in PyTorch: functions of many states with exact derivatives, for `backward` and `torch.autograd.grad`.

    from flexmb.bridges.torch import accelerations
    f = accelerations(system)
    udot = f(q, u, forces, t)                     (n,nq), (n,nu), (n,nu), (n,) -> (n,nu)

The equations are evaluated by flexmb on the processor. Derivatives of second order are not to be had.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexmb.bridges.functions import Accelerations, Function, InverseDynamics
from flexmb.system.system import System

try:
    import torch
    from torch.autograd.function import once_differentiable
except ImportError as error:  # pragma: no cover
    raise ImportError("PyTorch is missing: see pytorch.org for how to install it") from error


def accelerations(system: System) -> Callable[..., torch.Tensor]:
    """`f(q, u, forces=0, t=0)`: udot (n,nu) of q (n,nq), u (n,nu), further generalised forces (n,nu), times (n,) in s.

    One state (nq,), (nu,) gives udot (nu,). NaN where there are no accelerations; derivatives there raise an error.
    TypeError for anything but tensors of 64 bits, ValueError for shapes that do not fit, NotImplementedError for scenes
    with controllers.
    """
    return _bridged(Accelerations(system))


def inverse_dynamics(system: System) -> Callable[..., torch.Tensor]:
    """`f(q, u, accelerations=0, t=0)`: tau (n,nu), the forces along the speeds that these accelerations need."""
    return _bridged(InverseDynamics(system))


def _bridged(of: Function) -> Callable[..., torch.Tensor]:
    class Bridged(torch.autograd.Function):
        @staticmethod
        def forward(context: Any, *arguments: torch.Tensor) -> torch.Tensor:
            context.save_for_backward(*arguments)
            return torch.from_numpy(of.values(*_rows(arguments)))

        @staticmethod
        @once_differentiable
        def backward(context: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, ...]:
            parts = of.jacobians(*_rows(context.saved_tensors))
            return tuple(torch.einsum("ni,ni...->n...", gradient, torch.from_numpy(part)) for part in parts)

    def called(q: torch.Tensor, u: torch.Tensor, third: Any = None, t: Any = None) -> torch.Tensor:
        leading = q.shape[:-1]
        third = torch.zeros_like(u) if third is None else third
        t = torch.zeros(leading, dtype=torch.float64) if t is None else t
        rows = [_checked(x, leading, shape) for x, shape in zip((q, u, third, t), of.shapes, strict=True)]
        values: torch.Tensor = Bridged.apply(*rows)
        return values.reshape(*leading, of.system.nu)

    return called


def _rows(arguments: Any) -> list[Any]:
    return [x.detach().contiguous().numpy() for x in arguments]


def _checked(x: Any, leading: tuple[int, ...], shape: tuple[int, ...]) -> torch.Tensor:
    if not isinstance(x, torch.Tensor) or x.dtype != torch.float64:
        kind = x.dtype if isinstance(x, torch.Tensor) else type(x).__name__
        raise TypeError(f"an argument of type {kind}: give tensors of type torch.float64")
    if x.shape != (*leading, *shape):
        raise ValueError(f"an argument has the shape {tuple(x.shape)} instead of {(*leading, *shape)}")
    return x.reshape(-1, *shape)
