"""Derivatives of closed chains: how their motion changes with the state, and their loads."""

from __future__ import annotations

from flexmb.closure.closures import Closures
from flexmb.closure.derivative_call import ChainDerivativeCall, chain_derivative_call, differentiate_chain
from flexmb.closure.tables import Closed
from flexmb.closure.variation import ChainVariation
from flexmb.scene.open_loop import refuse_feedback
from flexmb.system.derivative_evaluator import DerivativeEvaluator, DerivativeRoute, fresh_derivative_evaluator
from flexmb.system.derivatives import INSTEAD, DifferentiableMotion
from flexmb.system.pushforward import Pushforward, pushforward
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State
from flexmb.typing import Real


def _fresh(system: ChainDerivatives) -> tuple[Closed, ChainDerivativeCall]:
    return chain_derivative_call(system.closures, system.nq, system.nu)


_OF_CHAINS = DerivativeRoute("derivatives of closed chains", lambda: differentiate_chain, _fresh)


class ChainDerivatives(DifferentiableMotion):
    """Derivatives of a system with closures or couplings."""

    _closures: Closures

    @per_thread
    def closures(self) -> Closures:
        """The closure equations with workspaces of this thread."""
        return self._closures.for_thread()

    def derivative_evaluator(self) -> DerivativeEvaluator:
        """As of a tree, by the recursion of the tree; states that are given must fulfil the closures."""
        refuse_feedback(self.scene, "system.derivative_evaluator", INSTEAD)
        self._determine_rows("system.derivative_evaluator")
        return fresh_derivative_evaluator(self, self.refusal, _OF_CHAINS)

    @per_thread
    def _variations(self) -> ChainVariation:
        return ChainVariation(self.closures, self.own_tangent)

    @per_thread
    def _pushforward(self) -> Pushforward:
        tables = self.constants, self.own_tangent, self.observation.out
        return pushforward(*tables, self.check_status, self.closures.constants[1])

    @property
    def _row_count(self) -> int:
        return len(self.closures.constants[1].row)

    def _without_kinks(self, state: State, what: str) -> tuple[float, Real]:
        """As of a tree; NotImplementedError for bodies whose inertia is not where closures join them."""
        self._determine_rows(what)
        return super()._without_kinks(state, what)

    def _determine_rows(self, what: str) -> None:
        if self.closures.at_rest:
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures and bodies of level "ruthless", whose inertia is not where '
                f'closures join them, and {what} does not support that: use level "linear" or a better one'
            )
        if self.closures.rank < 0:
            self.initial_state  # noqa: B018 - counts the independent rows, or no position is seen to be singular

    def _given(self, accelerations: Real) -> Real:
        raise NotImplementedError(
            f'scene "{self.scene.name}" has closures, and derivatives of loads for given accelerations are for trees '
            "only: leave accelerations out, or prescribe coordinates"
        )
