"""Moving frames with their Jacobians, and the field of displacement of a flexible body."""

from dataclasses import dataclass

import numpy as np

from .rotations import cross, skew


@dataclass
class JacobianFrame:
    """A moving frame: rotation R, position r, velocities w, v = W u, V u, accelerations alpha, a for udot = 0."""

    R: np.ndarray
    r: np.ndarray
    W: np.ndarray
    V: np.ndarray
    w: np.ndarray
    v: np.ndarray
    alpha: np.ndarray
    a: np.ndarray

    def at(self, offset, rotation):
        """A frame fixed to this one, `offset` and `rotation` in its axes."""
        d = self.R @ offset
        carried = cross(self.alpha, d) + cross(self.w, cross(self.w, d))
        return JacobianFrame(
            self.R @ rotation, self.r + d, self.W, self.V - skew(d) @ self.W, self.w, self.v + cross(self.w, d),
            self.alpha, self.a + carried,
        )

    def moved(self, shift, shift_map, shift_bias, rotation, turn_map, turn_bias, u):
        """A frame that moves in this one: displacement, its rate shift_map u and what that rate has for udot = 0; the
        rotation, its angular velocity turn_map u and likewise; all in the axes of this frame."""
        there = self.at(shift, np.eye(3))
        Vr, Wr = self.R @ shift_map, self.R @ turn_map
        vr, wr = Vr @ u, Wr @ u
        return JacobianFrame(
            self.R @ rotation, there.r, there.W + Wr, there.V + Vr, there.w + wr, there.v + vr,
            there.alpha + self.R @ turn_bias + cross(self.w, wr),
            there.a + self.R @ shift_bias + 2.0 * cross(self.w, vr),
        )


def field(p, eta, rate):
    """Of points with modes (n,3,m): place, its derivative by eta, the rate of that times `rate`; likewise of the
    rotation vector. Points of level "stiffened" have a field of second order too."""
    r, Phi, Psi = p["position_m"], p["translation_modes"], p["rotation_modes"]
    place, theta = r + Phi @ eta, Psi @ eta
    none = np.zeros_like(r)
    if "second_translation" not in p:
        return place, Phi, none, theta, Psi, none
    G, H = p["second_translation"] @ eta, p["second_rotation"] @ eta
    bias, turning = p["second_translation"] @ rate @ rate, p["second_rotation"] @ rate @ rate
    return place + 0.5 * G @ eta, Phi + G, bias, theta + 0.5 * H @ eta, Psi + H, turning
