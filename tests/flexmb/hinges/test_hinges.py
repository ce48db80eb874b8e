"""Identities of every hinge kind: its map and bias are the derivatives of its pose, its rate keeps quaternions unit."""

import numpy as np
import pytest

import flexmb
from flexmb.hinges import catalogue
from flexmb.hinges.catalogue import KINDS
from flexmb.hinges.free import HINGE as FREE
from flexmb.hinges.gimbal2 import HINGE as GIMBAL2
from flexmb.hinges.gimbal3 import HINGE as GIMBAL3
from flexmb.hinges.kind import HingeKind
from flexmb.jit.bundle import bundle
from flexmb.jit.features import GENERAL
from flexmb.jit.kernel import kernel
from flexmb.scene.build import SceneBuilder, angular
from flexmb.tables.state import DynamicsError
from tests.bounds import gamma
from tests.flexmb import spectral

SPAN = 0.4  # s; the motions below turn by less than 1 rad in it
I, J = 1, 2  # first places in q and u: a hinge must not care where it is
SEQUENCES = {GIMBAL2: ["xy", "zy", "yx"], GIMBAL3: ["xyz", "zxz", "yzx", "xyx"]}
PARAMETERS = np.array([0.3, 0.0, 0.0])  # m/rad, the pitch of a screw
CASES = [(kind, sequence) for kind in KINDS for sequence in SEQUENCES.get(kind, ["xyz"])]


@bundle
class Anything:
    """A scene with hinges of all kinds."""

    nothing: np.ndarray  # (0,)

    def features(self) -> frozenset[str]:
        return frozenset({GENERAL})


SCENE = Anything(np.zeros(0))


@kernel
def pose(c, kind, q, i, sequence, parameters):
    return catalogue.pose(c, kind, q, i, sequence, parameters)


@kernel
def motion(c, kind, q, i, u, j, sequence, parameters, H):
    return catalogue.motion(c, kind, q, i, u, j, sequence, parameters, H)


@kernel
def rate(c, kind, q, i, u, j, dq):
    catalogue.rate(c, kind, q, i, u, j, dq)


class Hinge:
    """One kind, moving: q(t) is smooth, u(t) follows from it, as qdot = rate(q, u) is linear in u."""

    def __init__(self, kind: HingeKind, sequence: str) -> None:
        self.kind, self.sequence = KINDS.index(kind), np.array(["xyz".index(axis) for axis in sequence])
        self.nq, self.nv, self.quaternion = kind.coordinates, kind.speeds, kind.quaternion
        self._curve = np.random.default_rng(self.kind).uniform(0.2, 0.8, (3, self.nq))
        if self.quaternion >= 0:
            self._curve[1:, self.quaternion :] *= 0.2  # the norm's complex zeros must stay far from SPAN

    def q(self, t: float) -> np.ndarray:
        """(nq,), away from singular angles."""
        q = self._curve[0] + self._curve[1] * t + 0.5 * self._curve[2] * t**2
        if self.quaternion >= 0:
            q[self.quaternion :] /= np.linalg.norm(q[self.quaternion :])
        return q

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, p = pose(SCENE, self.kind, np.append(np.zeros(I), q), I, self.sequence, PARAMETERS)
        return np.reshape(R, (3, 3)), np.array(p)

    def motion(self, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
        """H (6,6) as left by the kernel, velocity (6,), bias (6,)."""
        H = np.zeros((6, 6))
        q, u = np.append(np.zeros(I), q), np.append(np.zeros(J), u)
        V, A = motion(SCENE, self.kind, q, I, u, J, self.sequence, PARAMETERS, H)
        return H, np.concatenate(V), np.concatenate(A)

    def rate(self, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        dq = np.full(I + self.nq, 9.0)
        rate(SCENE, self.kind, np.append(np.zeros(I), q), I, np.append(np.zeros(J), u), J, dq)
        assert np.all(dq[:I] == 9.0), "writes outside its own coordinates"
        return dq[I:]

    def speeds(self, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """u (nv,) that moves q at the rate qdot."""
        N = np.array([self.rate(q, e) for e in np.eye(self.nv)]).reshape(self.nv, self.nq).T
        return np.linalg.lstsq(N, qdot, rcond=None)[0]


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0].name} {case[1]}")
def hinge(request) -> Hinge:
    return Hinge(*request.param)


def skew_part(A: np.ndarray) -> np.ndarray:
    return 0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])


def test_rate_covers_every_smooth_motion(hinge):
    """qdot = rate(q, u) has a solution u for every motion on the configuration manifold."""
    q, qdot = hinge.q(0.0), spectral.at_zero(spectral.along(hinge.q, SPAN), SPAN)[0]
    bound = spectral.rounding(SPAN, 1, 1.0)
    assert np.max(np.abs(hinge.rate(q, hinge.speeds(q, qdot)) - qdot), initial=0.0) <= bound


def test_map_and_bias_are_derivatives_of_the_pose(hinge):
    """H u = V and H udot + bias = A, both seen from the inboard frame in outboard axes."""
    qs = spectral.along(hinge.q, SPAN)
    rates = np.tensordot(spectral.matrix(SPAN), qs, 1)
    us = np.array([hinge.speeds(q, qdot) for q, qdot in zip(qs, rates, strict=True)])
    udot = spectral.at_zero(us, SPAN)[0]
    R, dR, ddR = (hinge.pose(hinge.q(0.0))[0], *spectral.at_zero(np.array([hinge.pose(q)[0] for q in qs]), SPAN))
    dp, ddp = spectral.at_zero(np.array([hinge.pose(q)[1] for q in qs]), SPAN)
    H, velocity, bias = hinge.motion(hinge.q(0.0), us[spectral.MIDDLE])
    H = H[:, : hinge.nv]

    size = 1.0 + np.max(np.abs(qs), initial=0.0)
    pose_digits = gamma(4 * 9)  # at most four products of rotations
    first = 4.0 * spectral.rounding(SPAN, 1, size, pose_digits)
    second = 4.0 * spectral.rounding(SPAN, 2, size, pose_digits)
    expected = np.append(skew_part(R.T @ dR), R.T @ dp)
    assert np.max(np.abs(H @ us[spectral.MIDDLE] - expected)) <= first
    assert np.max(np.abs(velocity - expected)) <= first
    acceleration = np.append(R.T @ skew_part(ddR @ R.T), R.T @ ddp)
    assert np.max(np.abs(H @ udot + bias - acceleration)) <= second


def test_bias_is_quadratic_in_the_speeds(hinge):
    """... and has no part left when the hinge is still."""
    rng = np.random.default_rng(1)
    q, u = hinge.q(0.0), rng.normal(size=hinge.nv)
    assert np.all(hinge.motion(q, 0.0 * u)[2] == 0.0)
    assert np.max(np.abs(hinge.motion(q, 2.0 * u)[2] - 4.0 * hinge.motion(q, u)[2])) <= gamma(60) * 4.0 * u @ u


def test_map_has_the_rank_of_its_freedoms(hinge):
    """... fills its own columns only, and does not depend on the speeds."""
    q = hinge.q(0.0)
    H = hinge.motion(q, np.ones(hinge.nv))[0]
    assert np.linalg.matrix_rank(H) == hinge.nv
    assert np.all(H[:, hinge.nv :] == 0.0)
    assert np.array_equal(H, hinge.motion(q, np.zeros(hinge.nv))[0])


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.quaternion >= 0], ids=lambda kind: kind.name)
def test_quaternion_norm_is_an_invariant_of_the_flow(kind):
    """... also off the unit sphere, and scaling the quaternion scales only its own rate."""
    hinge = Hinge(kind, "xyz")
    rng = np.random.default_rng(2)
    q, u, part = rng.normal(size=hinge.nq), rng.normal(size=hinge.nv), slice(hinge.quaternion, None)
    dq = hinge.rate(q, u)
    assert abs(q[part] @ dq[part]) <= gamma(16) * np.linalg.norm(q[part]) ** 2 * np.linalg.norm(u)
    scaled = q.copy()
    scaled[part] *= 3.0
    expected = dq.copy()
    expected[part] *= 3.0
    assert np.max(np.abs(hinge.rate(scaled, u) - expected)) <= gamma(40) * 3.0 * np.max(np.abs(q)) * np.sum(np.abs(u))


def test_free_rate_turns_the_velocity_to_inboard_axes():
    """A free hinge turned by a quarter about z: velocity along outboard x is motion along inboard y."""
    half = np.sqrt(0.5)
    q, u = np.array([0.0, 0.0, 0.0, half, 0.0, 0.0, half]), np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0])
    assert Hinge(FREE, "xyz").rate(q, u)[:3] == pytest.approx([0.0, 2.0, 0.0], abs=gamma(20))


@pytest.mark.parametrize(("sequence", "middle"), [("zxz", 0.0), ("xyz", np.pi / 2), ("yzx", -np.pi / 2)])
def test_gimbal_lock_is_named(sequence, middle):
    """Where the first and third axis align, the map loses rank and the dynamics says so instead of a number."""
    hinge = Hinge(GIMBAL3, sequence)
    H = hinge.motion(np.array([0.3, middle, 0.4]), np.zeros(3))[0]
    assert np.linalg.matrix_rank(H, tol=gamma(20)) == 2
    turns = [angular(angle=0.3), angular(angle=0.8), angular(angle=0.4)]  # a scene may not start locked
    scene = (
        SceneBuilder("locked")
        .rigid_body("arm", mass=1.0, com=(0.3, 0.1, 0.0), inertia=(0.2, 0.3, 0.4))
        .gimbal("pivot", "ground", "arm", sequence=sequence, rotations=turns)
        .scene()
    )
    system = flexmb.compile(scene)
    with pytest.raises(DynamicsError, match='"arm".*not positive definite'):
        system.accelerations(system.state([0.3, middle, 0.4], np.zeros(3)))
