"""What derivatives by numbers need of a compiled scene. `flexmb.system` has it, which stands above this room."""

from __future__ import annotations

from typing import Any, Protocol

from flexmb.closure.closures import Closures
from flexmb.entry.observation import Outputs
from flexmb.scene.schema import Scene
from flexmb.tables.arrays import Constants
from flexmb.tables.state import Layout, State
from flexmb.typing import Real


class ObservedRows(Protocol):
    """The arrays of everything observable, and a row of them by the names of the scene."""

    width: int

    def outputs(self) -> Outputs: ...

    def evaluation(self, row: Real) -> Any: ...


class Plant(Protocol):
    """A compiled scene: a tree, whose `closures` are None, or a closed chain."""

    scene: Scene
    constants: Constants
    layout: Layout
    nq: int
    nu: int
    is_smooth: bool

    @property
    def initial_state(self) -> State: ...

    @property
    def closures(self) -> Closures | None: ...

    @property
    def observation(self) -> ObservedRows: ...

    def observe_row(self, t: float, y: Real, algorithm: Any, row: Real) -> None: ...

    def check_status(self, status: int, fault: int | None = None) -> None: ...

    def refuse_corners(self, t: float, y: Real) -> None: ...

    def with_numbers(self, scene: Scene) -> Plant:
        """The system of the same scene with slightly other numbers, whose tables are smooth functions of these."""
