"""Rigid loops against Pinocchio's constraintDynamics: welds and spherical closures, which it has."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from tests import trees
from tests.flexmb.closure import chains

pin = pytest.importorskip("pinocchio")
from crosscheck.engines.conventions import frame  # noqa: E402
from crosscheck.engines.links import Floating, Scalar, attachment, links  # noqa: E402
from crosscheck.engines.pinocchio.dynamics import Dynamics  # noqa: E402
from crosscheck.engines.pinocchio.tree import build_tree, initial_state, placement  # noqa: E402

HINGES = tuple(kind for kind in trees.KINDS if kind != "weld")
LOOPS = replace(trees.CONSERVATIVE, carriers=("rigid",), wheels=0, point_masses=0, hinges=HINGES, branching=False)
# Its proximal iterations stop at a residual, so that close to redundant rows it is less accurate than it could be.
SETTINGS = (1e-15, 1e-15, 1e-12, 100)


class Peer:
    """The tree and its closures in Pinocchio."""

    def __init__(self, scene: s.Scene) -> None:
        tree = msgspec.structs.replace(scene, closures=())
        chain = links(tree)
        self.tree = build_tree(chain, np.array(scene.gravity_m_s2))
        self.dynamics = Dynamics(self.tree, tree)
        self.closures = pin.StdVec_RigidConstraintModel()
        for closure in scene.closures:
            kind = pin.ContactType.CONTACT_6D if closure.type == "weld" else pin.ContactType.CONTACT_3D
            sides = [side for end in "ab" for side in self._side(tree, chain, closure, end)]
            self.closures.append(pin.RigidConstraintModel(kind, self.tree.model, *sides, pin.ReferenceFrame.LOCAL))

    def _side(self, scene: s.Scene, chain, closure: s.Closure, end: str):
        body, node = getattr(closure, f"body_{end}"), getattr(closure, f"node_{end}")
        offset = frame(getattr(closure, f"position_{end}_m"), getattr(closure, f"quaternion_{end}"))
        if body == "ground":
            return 0, placement(offset)
        at = attachment(scene, chain, s.Marker(name="", body=body, node=node))
        return self.tree.joints[at.link], placement(at.frame @ offset)

    def speeds(self, system: flexmb.System, u: np.ndarray) -> np.ndarray:
        """Our speeds in its order."""
        v, used = np.zeros(self.tree.model.nv), {}
        for slot in self.tree.slots:
            ours = u[system.speed(slot.link.joint)]
            if isinstance(slot.freedom, Scalar):
                first = used.get(slot.link.joint, 0)
                v[slot.v], used[slot.link.joint] = ours[first], first + 1
            else:
                order = np.r_[3:6, 0:3] if isinstance(slot.freedom, Floating) else np.r_[0:3]
                v[slot.v : slot.v + len(order)] = ours[order]
        return v

    def solve(self, v: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Accelerations, and by closure [torque; force] on body_b about B in World axes."""
        q, _ = initial_state(self.tree)
        tau = self.dynamics.forces.springs(q) + self.dynamics.forces.dampers_and_motors(0.0, v)
        model, data = self.tree.model, self.tree.model.createData()
        datas = pin.StdVec_RigidConstraintData()
        for closure in self.closures:
            datas.append(closure.createData())
        pin.initConstraintDynamics(model, data, self.closures, datas)
        rates = pin.constraintDynamics(model, data, q, v, tau, self.closures, datas, pin.ProximalSettings(*SETTINGS))
        loads = []
        for each in datas:
            R = each.oMc1.rotation
            loads.append(-np.concatenate([R @ each.contact_force.angular, R @ each.contact_force.linear]))
        return np.array(rates), loads


# Loops without redundant rows: Pinocchio's loads of others are not the least.
TYPES = (("weld",), ("spherical",), ("spherical", "spherical"), ("weld", "spherical"))
CASES = [(types, seed) for types in TYPES for seed in (2, 3)]


@pytest.mark.parametrize(("types", "seed"), CASES, ids=str)
def test_accelerations_and_loads(types, seed):
    scene = chains.with_closures(trees.random_scene(seed, LOOPS), np.random.default_rng(seed), list(types))
    system = flexmb.compile(scene)
    start = flexmb.System(scene).initial_state
    state = system.state(start.q, chains.consistent_speeds(scene, start.q, start.u))
    ours = system.evaluate(0.0, state.q, state.u)
    assert system.closures.null_loads().shape[1] == 0
    peer = Peer(scene)
    rates, loads = peer.solve(peer.speeds(system, state.u))
    found = peer.speeds(system, ours.accelerations)
    assert np.max(np.abs(found - rates)) <= 1e-9 * np.max(np.abs(rates))
    largest = max(np.max(np.abs(load)) for load in ours.loads.values())
    for closure, load in zip(scene.closures, loads, strict=True):
        assert np.max(np.abs(ours.loads[closure.name] - load)) <= 1e-8 * largest
