"""Import of MJCF models by MuJoCo's own compiler.

MuJoCo resolves defaults, inertia of shapes, all notations of frames, and included files. A joint becomes a hinge with
the same name; between the joints of a body with several of them there are bodies without mass. Coordinates are relative
to the model's reference pose `qpos0`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from flexmb.interchange.imported import SMOOTH, STOPS, ImportedScene, JointConnectors, ModelError, listed, naming
from flexmb.interchange.mjcf_equalities import (
    CONNECT,
    JOINT,
    TENDON,
    WELD,
    MjcfClosures,
    MjcfCouplings,
    tendon_that_acts,
)
from flexmb.interchange.mjcf_text import refuse_bad_text
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.rigid_equivalent import steiner
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

FREE, BALL, SLIDE, HINGE = range(4)  # mjtJoint
SINGLE = (SLIDE, HINGE)
KNOWN_EQUALITIES = (CONNECT, WELD, JOINT, TENDON)
JOINT_TRANSMISSIONS = (0, 1)  # mjtTrn: joint, jointinparent, which are the same for hinges and slides


def read_mjcf(
    path: str | os.PathLike[str], *, stop_stiffness: float | None = None, smoothing: float | None = None
) -> ImportedScene:
    """The rigid tree of an MJCF file (or of a URDF file, as MuJoCo reads it), at its reference pose and at rest.

    Springs, dampers and armatures of joints are included, those of actuators at joints too, and gravity compensation.
    The armature of a free joint is mass and inertia that its body has without weight. Linear equality constraints
    between joints or of fixed tendons become couplings, connect and weld become closures. With `stop_stiffness`
    (N m/rad or N/m) limits of hinges and slides become stops, with `smoothing` (rad/s or m/s) their dry friction
    becomes a connector that is smooth below that rate. Contacts, other limits and friction, forces of actuators,
    tendons that only measure or pull, and sensors are omitted, and the notes list them. Raises ImportError without
    MuJoCo; ModelError for a file that MuJoCo refuses, for numbers that are not finite, which MuJoCo would replace by
    defaults (`flexmb.interchange.mjcf_text`), and for what changes the motion and has no counterpart in a scene:
    nonlinear equality constraints, tendons with springs, dampers or armatures, armatures of ball joints, nonlinear
    springs and dampers, fluids, flexible parts. ValueError for options that are not positive.
    """
    try:
        import mujoco
    except ImportError:
        raise ImportError("MJCF is read by MuJoCo's own compiler: pip install mujoco") from None
    refuse_bad_text(Path(path))
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise ModelError(f"{path}: MuJoCo refuses the model: {error}") from None
    with naming(str(path)):
        return _Model(str(path), model, stop_stiffness, smoothing).scene()


class _Model:
    """A compiled model; `m` has MuJoCo's names."""

    def __init__(self, file: str, m: Any, stop_stiffness: float | None, smoothing: float | None) -> None:
        self.file, self.m = file, m
        self._refuse()
        taken = {str(m.joint(j).name) for j in range(m.njnt)} | {str(m.equality(i).name) for i in range(m.neq)}
        self.extras = JointConnectors(stop_stiffness, smoothing, taken)
        self.couplings = MjcfCouplings(m, [self._joint_name(j) for j in range(m.njnt)], self._fail)
        self.closures = MjcfClosures(m, self._body_name)
        self._armature, self._damping = self._along_dofs("armature"), self._along_dofs("damping")
        if self._switched_off("DAMPER"):
            self._damping[:] = 0.0

    def scene(self) -> ImportedScene:
        m = self.m
        self.gravity = np.zeros(3) if self._switched_off("GRAVITY") else np.array(m.opt.gravity)
        builder = SceneBuilder(Path(self.file).stem, gravity=self.gravity)
        for k in range(1, m.nbody):
            self._body(builder, k)
        self.couplings.couple(builder)
        self.closures.close(builder)
        for j in range(m.njnt):
            self._connect(builder, j)
        return ImportedScene(builder.scene(), tuple(self._notes()))

    def _body(self, builder: SceneBuilder, k: int) -> None:
        """Body k and its joints; all joints but the last move massless bodies."""
        m, name = self.m, self._body_name(k)
        R = rotation_matrix(m.body_iquat[k])
        inertia = R @ np.diag(m.body_inertia[k]) @ R.T
        own, com, extra = float(m.body_mass[k]), np.array(m.body_ipos[k]), self._borne(k)
        lift = -float(m.body_gravcomp[k]) * own * self.gravity
        # an armature of all six speeds is a point mass at the frame and an inertia that is the same about all axes
        reduced = own * extra / ((own + extra) or 1.0)
        inertia = 0.5 * (inertia + inertia.T) + extra * np.eye(3)
        builder.rigid_body(
            name, mass=own + extra, com=own * com / ((own + extra) or 1.0) if extra else com,
            inertia=inertia + steiner(reduced, com),
            nodes={"mass centre": com} if np.any(lift) else (),
        )  # fmt: skip
        self._lift(builder, f"{name}.gravcomp", name, "mass centre", lift)
        self._lift(builder, f"{name}.armature", name, "origin", -extra * self.gravity)
        parent = self._body_name(int(m.body_parentid[k]))
        at = {"parent_position": m.body_pos[k], "parent_quaternion": m.body_quat[k]}
        joints = range(m.body_jntadr[k], m.body_jntadr[k] + m.body_jntnum[k])
        if len(joints) == 0:
            builder.weld(f"{name}.weld", parent, name, **at)
        for j in joints:
            last = j == joints[-1]
            child = name if last else f"{name}.{self._joint_name(j)}"
            if not last:
                builder.rigid_body(child, mass=0.0, inertia=np.zeros((3, 3)))
            self._hinge(builder, j, parent, child, at)
            parent, at = child, {"parent_position": np.zeros(3), "parent_quaternion": np.array([1.0, 0.0, 0.0, 0.0])}

    def _borne(self, k: int) -> float:
        """kg and kg m²: the armature of the free joint of body k."""
        first = int(self.m.body_jntadr[k])
        free = self.m.body_jntnum[k] == 1 and self.m.jnt_type[first] == FREE
        return float(self._armature[self.m.jnt_dofadr[first]]) if free else 0.0

    def _lift(self, builder: SceneBuilder, name: str, body: str, node: str, lift: Real) -> None:
        """A constant force (3,) N in World axes, where there is any."""
        if np.any(lift):
            size = float(np.linalg.norm(lift))
            builder.force(name, body, node=node, direction=lift / size, function=Constant(value=size))

    def _connect(self, builder: SceneBuilder, j: int) -> None:
        """Stops at the limits of a hinge or slide, and its dry friction, where they were asked for."""
        m, name, turns = self.m, self._joint_name(j), int(self.m.jnt_type[j]) == HINGE
        if int(m.jnt_type[j]) not in SINGLE:
            return
        if m.jnt_limited[j] and self.extras.stop_stiffness is not None:
            lower, upper = (float(each - m.qpos0[m.jnt_qposadr[j]]) for each in m.jnt_range[j])
            self.extras.stop(builder, name, turns, lower, upper)
        sliding = float(m.dof_frictionloss[m.jnt_dofadr[j]])
        if sliding and self.extras.smoothing is not None:
            self.extras.rub(builder, name, turns, sliding)

    def _hinge(self, builder: SceneBuilder, j: int, parent: str, child: str, at: dict[str, Any]) -> None:
        m, name, dof = self.m, self._joint_name(j), int(self.m.jnt_dofadr[j])
        kind, anchor = int(m.jnt_type[j]), m.jnt_pos[j]
        if kind == FREE:
            builder.free(name, parent, child, **at)
            return
        frames = at | {
            "parent_position": at["parent_position"] + rotation_matrix(at["parent_quaternion"]) @ anchor,
            "child_position": anchor,
        }
        damping, stiffness = float(self._damping[dof]), self._stiffness(j)
        if kind == BALL:
            builder.spherical(name, parent, child, stiffness=stiffness, damping=damping, **frames)
            return
        place = int(m.jnt_qposadr[j])
        rest = float(m.qpos_spring[place] - m.qpos0[place])
        make = builder.prismatic if kind == SLIDE else builder.revolute
        make(
            name, parent, child, axis=m.jnt_axis[j], stiffness=stiffness, rest=rest, damping=damping,
            prescribed=self.couplings.held.get(j),
            armature=float(self._armature[dof]), **frames,
        )  # fmt: skip

    def _along_dofs(self, what: str) -> Real:
        """(nv,) armature or damping of joints, and what actuators at joints add to it: gear^2 times their own."""
        m = self.m
        values = np.array(getattr(m, f"dof_{what}"), float)
        for i, own in enumerate(getattr(m, f"actuator_{what}", ())):
            if own:  # at a hinge or a slide, see `_refuse`
                values[m.jnt_dofadr[m.actuator_trnid[i, 0]]] += m.actuator_gear[i, 0] ** 2 * own
        return values

    def _stiffness(self, j: int) -> float:
        return 0.0 if self._switched_off("SPRING") else float(self.m.jnt_stiffness[j])

    def _switched_off(self, flag: str) -> bool:
        """Whether an option of the model disables gravity, springs or dampers."""
        import mujoco

        return bool(self.m.opt.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))

    def _body_name(self, k: int) -> str:
        if k == 0:
            return GROUND
        name = str(self.m.body(k).name) or f"body {k}"
        return name if name != GROUND else f"{name} {k}"

    def _joint_name(self, j: int) -> str:
        return str(self.m.joint(j).name) or f"{self._body_name(int(self.m.jnt_bodyid[j]))}.joint {j}"

    def _refuse(self) -> None:
        """ModelError for elements that change the motion and have no counterpart in a scene."""
        m = self.m
        for count, what, remedy in (
            (
                int(np.sum(~np.isin(m.eq_type, KNOWN_EQUALITIES))),
                "equality constraints of flexible parts",
                "remove them, and add flexible bodies to the scene",
            ),
            (getattr(m, "nflex", 0), "flexible parts", "remove them, and add flexible bodies to the scene"),
            (m.npluginstate, "plugins", "remove them"),
        ):
            if count:
                self._fail(f"it has {count} {what}, which scenes do not support", remedy)
        if acts := tendon_that_acts(m):
            self._fail(f"{acts}, which scenes do not support", "remove it, or give the joints springs")
        self._refuse_actuators()
        self._refuse_nonlinear_joints()
        if m.opt.density or m.opt.viscosity or np.any(m.opt.wind):
            self._fail("option has density, viscosity or wind, and scenes have no fluid", "set them to zero")
        for j in range(m.njnt):
            first, place = int(m.jnt_dofadr[j]), int(m.jnt_qposadr[j])
            if m.jnt_type[j] == BALL and m.dof_armature[first]:
                what = f'the ball joint "{self._joint_name(j)}" has the armature {m.dof_armature[first]:g}'
                self._fail(what, "set it to zero: in scenes, only coordinates of hinges with axes have armatures")
            if m.jnt_type[j] == FREE and (m.jnt_stiffness[j] or np.any(m.dof_damping[first : first + 6])):
                self._fail(f'free joint "{self._joint_name(j)}" has a spring or damper', "remove it")
            turn = m.qpos_spring[place : place + 4] - m.qpos0[place : place + 4]
            if m.jnt_type[j] == BALL and m.jnt_stiffness[j] and np.max(np.abs(turn)) > ROUNDING:
                self._fail(f'the spring of ball joint "{self._joint_name(j)}" is at rest elsewhere', "turn its body")

    def _refuse_actuators(self) -> None:
        """Armatures and dampers of actuators are those of their joints, if they are at hinges or slides."""
        m = self.m
        for i in range(len(m.actuator_trntype)):
            own = [key for key in ("armature", "damping", "dampingpoly") if np.any(_entry(m, f"actuator_{key}", i))]
            at_joint = m.actuator_trntype[i] in JOINT_TRANSMISSIONS and m.jnt_type[m.actuator_trnid[i, 0]] in SINGLE
            if "dampingpoly" in own or (own and not at_joint):
                name = str(m.actuator(i).name) or f"actuator {i}"
                what = f'actuator "{name}" has {own[-1].removesuffix("poly")}'
                self._fail(what, "give armature and linear damping to joints, or to actuators of hinges and slides")

    def _refuse_nonlinear_joints(self) -> None:
        m = self.m
        for j in range(m.njnt):
            powers = _entry(m, "jnt_stiffnesspoly", j), _entry(m, "dof_dampingpoly", m.jnt_dofadr[j])
            if any(map(np.any, powers)) or (m.jnt_stiffness[j] and _entry(m, "jnt_springyield", j)):
                what = f'joint "{self._joint_name(j)}" has a nonlinear spring or damper, or a spring that yields'
                self._fail(what, "leave one number for each")

    def _notes(self) -> list[str]:
        m = self.m
        joints = [self._joint_name(j) for j in range(m.njnt)]
        notes = []
        if any(m.geom_contype) or any(m.geom_conaffinity):
            notes.append("contacts are left out: bodies pass through each other")
        single = [kind in SINGLE for kind in m.jnt_type.tolist()]
        stopped = self.extras.stop_stiffness is not None
        if limited := [joints[j] for j in range(m.njnt) if m.jnt_limited[j] and not (stopped and single[j])]:
            notes.append(f"limits of joints are left out: {listed(limited)}{'' if stopped else f' ({STOPS})'}")
        smooth = self.extras.smoothing is not None
        rubbing = {int(m.dof_jntid[i]) for i in np.flatnonzero(m.dof_frictionloss)}
        if rough := [joints[j] for j in sorted(rubbing) if not (smooth and single[j])]:
            notes.append(f"dry friction is left out: {listed(rough)}{'' if smooth else f' ({SMOOTH})'}")
        if heavy := [joints[j] for j in range(m.njnt) if m.jnt_type[j] == FREE and self._armature[m.jnt_dofadr[j]]]:
            notes.append(f"armatures of free joints are mass and inertia without weight: {listed(heavy)}")
        if idle := [str(m.tendon(k).name) or f"tendon {k}" for k in range(m.ntendon)]:
            notes.append(f"limits, friction and actuators of tendons are left out: {listed(idle)}")
        if self.couplings.count:
            notes.append("equality constraints of coordinates are exact here, and springs and dampers in MuJoCo")
        if self.closures.count:
            notes.append("equality constraints of bodies are exact here, and springs and dampers in MuJoCo")
        if inactive := [*self.couplings.inactive, *self.closures.inactive]:
            notes.append(f"inactive equality constraints are left out: {listed(inactive)}")
        if m.nu:
            notes.append(f"{m.nu} actuators are left out, with the forces of servos at zero control")
        if moved := [joints[j] for j in range(m.njnt) if m.jnt_type[j] > BALL and m.qpos0[m.jnt_qposadr[j]] != 0.0]:
            notes.append(f"coordinates count from the reference position, not from zero: {listed(moved)}")
        return notes

    def _fail(self, what: str, remedy: str) -> NoReturn:
        raise ModelError(f"{self.file}: {what}: {remedy}")


def _entry(m: Any, key: str, i: int) -> Any:
    """An entry of one of MuJoCo's arrays; zero in versions that do not have the array."""
    return getattr(m, key)[i] if hasattr(m, key) else 0.0
