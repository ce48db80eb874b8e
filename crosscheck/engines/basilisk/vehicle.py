"""A craft as Basilisk's `Spacecraft` with its effectors: states put in, rates of states taken out.

Conventions of Basilisk: the hub's states are the position and velocity of its frame's origin in inertial axes, modified
Rodrigues parameters, and the angular velocity in hub axes; matrices named DCM_BA map components in A to those in B.
Wheels belong to the hub's mass and inertia, and their speeds are relative to it. A motor's torque holds over a step, so
it is put in anew for every evaluation: that of wheels at once, that of chains by a message.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.simulation import (
    extForceTorque,
    linearTranslationNDOFStateEffector,
    reactionWheelStateEffector,
    spacecraft,
    spinningBodyNDOFStateEffector,
)

from crosscheck.engines.basilisk.craft import Craft, CraftPart, CraftWheel
from crosscheck.engines.links import by_motion
from flexmb.typing import Real

_STEP = 1.0  # s; equations of motion take a step for noise, of which there is none
NEGLIGIBLE = 1e-200
"""kg or kg m^2: Basilisk refuses parts without mass or inertia; this is below the round-off of what it is added to."""


class Vehicle:
    def __init__(self, craft: Craft) -> None:
        self._craft = spacecraft.Spacecraft()
        self._craft.hub.mHub = craft.hub.mass
        self._craft.hub.r_BcB_B = _column(craft.hub.com)
        self._craft.hub.IHubPntBc_B = craft.hub.inertia.tolist()
        self._wheels = _wheels(craft)
        if craft.wheels:
            self._craft.addStateEffector(self._wheels)
        self._chains = [_Chain([craft.parts[number] for number in chain]) for chain in craft.chains]
        for chain in self._chains:
            self._craft.addStateEffector(chain.effector)
        self._outside = extForceTorque.ExtForceTorque()
        self._craft.addDynamicEffector(self._outside)
        self._craft.Reset(0)
        hub, states = self._craft.hub, self._craft.dynManager
        self._position = states.getStateObject(hub.nameOfHubPosition)
        self._velocity = states.getStateObject(hub.nameOfHubVelocity)
        self._attitude = states.getStateObject(hub.nameOfHubSigma)
        self._turning = states.getStateObject(hub.nameOfHubOmega)
        self._spins = states.getStateObject(self._wheels.nameOfReactionWheelOmegasState) if craft.wheels else None
        for chain in self._chains:
            chain.find(states)

    def put(self, position: Real, quaternion: Real, velocity: Real, turning: Real, spins: Real) -> None:
        """The hub's state, velocities in World and in hub axes; MRPs of the shorter way round are never singular."""
        w = abs(quaternion[0])
        sign = 1.0 if quaternion[0] >= 0.0 else -1.0
        self._position.setState(_column(position))
        self._velocity.setState(_column(velocity))
        self._attitude.setState(_column(sign * quaternion[1:] / (1.0 + w)))
        self._turning.setState(_column(turning))
        if self._spins is not None:
            self._spins.setState(_column(spins))

    def put_chain(self, number: int, values: Real, rates: Real, efforts: Real) -> None:
        """Coordinates, speeds, and motor torques or forces beyond springs and dampers, of a chain's parts."""
        self._chains[number].put(values, rates, efforts)

    def drive_wheels(self, torques: Real) -> None:
        for wheel, torque in zip(self._wheels.ReactionWheelData, torques, strict=True):
            wheel.u_current = float(torque)

    def push(self, force: Real, torque_on_hub: Real) -> None:
        """A force at the hub's origin in World axes, and the torque about it in hub axes."""
        self._outside.extForce_N = _column(force)
        self._outside.extTorquePntB_B = _column(torque_on_hub)

    def solve(self, t: float) -> tuple[Real, Real, Real, list[Real]]:
        """Accelerations of the hub: linear in World axes, angular in hub axes; of the wheels' speeds; of each chain."""
        self._craft.equationsOfMotion(t, _STEP)
        spins = np.zeros(0) if self._spins is None else _array(self._spins.getStateDeriv())
        linear, angular = _array(self._velocity.getStateDeriv()), _array(self._turning.getStateDeriv())
        return linear, angular, spins, [chain.accelerations() for chain in self._chains]

    def energy(self, t: float) -> float:
        """Kinetic energy and that of the chains' springs (J), of the state solved last."""
        self._craft.computeEnergyMomentum(t)
        return float(self._craft.totRotEnergy + self._craft.totOrbEnergy)

    def momentum(self, rotation: Real, velocity: Real, turning: Real) -> Real:
        """[angular about the World origin; linear] (6,), after `energy`; of a hub that is turned by `rotation`."""
        named = self._craft.dynManager.getPropertyReference
        (mass,), com, drift = (_array(named(name)) for name in ("m_SC", "centerOfMassSC", "centerOfMassPrimeSC"))
        angular = _array(self._craft.totOrbAngMomPntN_N) + _array(self._craft.totRotAngMomPntC_N)
        return np.concatenate([angular, mass * (velocity + rotation @ (drift + np.cross(turning, com)))])


class _Chain:
    def __init__(self, parts: list[CraftPart]) -> None:
        turns = by_motion(parts[0].freedom, True, False)
        self.effector, self._names = _turning_chain(parts) if turns else _sliding_chain(parts)
        self._payload = messaging.ArrayMotorTorqueMsgPayload if turns else messaging.ArrayMotorForceMsgPayload
        self._message: Any = (messaging.ArrayMotorTorqueMsg if turns else messaging.ArrayMotorForceMsg)()
        (self.effector.motorTorqueInMsg if turns else self.effector.motorForceInMsg).subscribeTo(self._message)
        self._field = "motorTorque" if turns else "motorForce"

    def find(self, states: Any) -> None:
        """Its states, which exist once the spacecraft has been set up."""
        self._values, self._rates = (states.getStateObject(name) for name in self._names)

    def put(self, values: Real, rates: Real, efforts: Real) -> None:
        self._values.setState(_column(values))
        self._rates.setState(_column(rates))
        payload = self._payload()
        setattr(payload, self._field, efforts.tolist())
        self._message.write(payload)
        self.effector.UpdateState(0)

    def accelerations(self) -> Real:
        return _array(self._rates.getStateDeriv())


def _wheels(craft: Craft) -> Any:
    effector = reactionWheelStateEffector.ReactionWheelStateEffector()
    for wheel in craft.wheels:
        effector.addReactionWheel(_wheel(wheel))
    return effector


def _wheel(wheel: CraftWheel) -> Any:
    made = reactionWheelStateEffector.RWConfigPayload()
    side = np.cross(wheel.axis, np.eye(3)[np.argmin(np.abs(wheel.axis))])
    side /= np.linalg.norm(side)
    made.gsHat_B = _column(wheel.axis)
    made.w2Hat0_B, made.w3Hat0_B = _column(side), _column(np.cross(wheel.axis, side))
    made.rWB_B = _column(np.zeros(3))
    made.Js = wheel.inertia
    made.RWModel = reactionWheelStateEffector.BalancedWheels
    return made


def _turning_chain(parts: list[CraftPart]) -> tuple[Any, tuple[str, str]]:
    effector = spinningBodyNDOFStateEffector.SpinningBodyNDOFStateEffector()
    for part in parts:
        body = spinningBodyNDOFStateEffector.SpinningBody()
        body.setMass(max(part.inertia.mass, NEGLIGIBLE))
        body.setISPntSc_S(_definite(part.inertia.inertia))
        body.setR_ScS_S(_column(part.inertia.com))
        body.setR_SP_P(_column(part.inboard.position))
        body.setDCM_S0P(part.inboard.rotation.T.tolist())
        body.setSHat_S(_column(part.freedom.axis))
        body.setK(part.freedom.stiffness)
        body.setC(part.freedom.damping)
        effector.addSpinningBody(body)
    return effector, (effector.getNameOfThetaState(), effector.getNameOfThetaDotState())


def _sliding_chain(parts: list[CraftPart]) -> tuple[Any, tuple[str, str]]:
    effector = linearTranslationNDOFStateEffector.LinearTranslationNDOFStateEffector()
    for part in parts:
        body = linearTranslationNDOFStateEffector.TranslatingBody()
        body.setMass(max(part.inertia.mass, NEGLIGIBLE))
        body.setIPntFc_F(_definite(part.inertia.inertia))
        body.setR_FcF_F(_column(part.inertia.com))
        body.setR_F0P_P(_column(part.inboard.position))
        body.setDCM_FP(part.inboard.rotation.T.tolist())
        body.setFHat_P(_column(part.inboard.rotation @ part.freedom.axis))
        body.setK(part.freedom.stiffness)
        body.setC(part.freedom.damping)
        effector.addTranslatingBody(body)
    return effector, (effector.getNameOfRhoState(), effector.getNameOfRhoDotState())


def _definite(inertia: Real) -> list[list[float]]:
    definite: list[list[float]] = (inertia + NEGLIGIBLE * np.eye(3)).tolist()
    return definite


def _column(vector: Real) -> list[list[float]]:
    return [[float(number)] for number in vector]


def _array(column: Any) -> Real:
    return np.array(column, dtype=float).reshape(-1)
