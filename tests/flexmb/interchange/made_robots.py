"""Robots for the tests: a six-axis arm with a tool, and a quadruped with a free base, as URDF and as MJCF."""

from __future__ import annotations

import numpy as np


def link(name: str, seed: int) -> str:
    """A link with an inertia in a frame that is turned and displaced."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(3, 3))
    squares = a @ a.T * 1e-2
    J = np.trace(squares) * np.eye(3) - squares
    xyz, rpy = rng.normal(size=3) * 0.1, rng.normal(size=3)
    numbers = " ".join(
        f'i{n}="{J[i, j]:.17g}"'
        for n, i, j in (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>'
        f'<mass value="{1.0 + rng.random():.17g}"/><inertia {numbers}/></inertial>'
        '<visual><geometry><mesh filename="package://nowhere/shape.stl"/></geometry></visual></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, seed: int, extra: str = "") -> str:
    rng = np.random.default_rng(1000 + seed)
    xyz, rpy, axis = rng.normal(size=3) * 0.3, rng.normal(size=3), rng.normal(size=3)
    along = (
        f'<axis xyz="{_words(axis / np.linalg.norm(axis))}"/>' if kind not in ("fixed", "floating", "planar") else ""
    )
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>{along}{extra}</joint>'
    )


LIMIT = '<limit effort="10" velocity="3" lower="-2" upper="2"/>'


def arm() -> str:
    """Six axes of all kinds in turned frames, a massless flange, a welded tool."""
    parts = [
        '<link name="base"/>',
        *(link(f"link{k}", k) for k in range(1, 7)),
        '<link name="flange"/>',
        link("tool", 9),
    ]
    kinds = ["revolute", "continuous", "prismatic", "revolute", "continuous", "revolute"]
    names = ["base", *(f"link{k}" for k in range(1, 7))]
    for k, kind in enumerate(kinds):
        extra = LIMIT + '<dynamics damping="0" friction="0"/>' if kind != "continuous" else ""
        parts.append(joint(f"axis{k + 1}", kind, names[k], names[k + 1], k, extra))
    parts += [joint("mount", "fixed", "link6", "flange", 7), joint("grip", "fixed", "flange", "tool", 8)]
    return f'<?xml version="1.0"?><robot name="arm">{"".join(parts)}</robot>'


def quadruped() -> str:
    """A trunk with four legs of three joints."""
    parts, seed = [link("trunk", 20)], 21
    for leg in ("fl", "fr", "hl", "hr"):
        parent = "trunk"
        for part in ("hip", "thigh", "shank"):
            name = f"{leg}_{part}"
            parts += [link(name, seed), joint(f"{name}_joint", "revolute", parent, name, seed, LIMIT)]
            parent, seed = name, seed + 1
    return f'<robot name="quadruped">{"".join(parts)}</robot>'


MJCF = """<mujoco model="creature">
  <compiler angle="radian"/>
  <option gravity="0.3 -0.2 -9.81"/>
  <default><joint damping="0.05"/></default>
  <worldbody>
    <body name="trunk" pos="0 0 1" euler="0.2 0.3 -0.1">
      <freejoint name="float"/>
      <geom type="box" size="0.2 0.1 0.05" mass="3" pos="0.02 0.01 0.03" euler="0.1 0.4 0.2"/>
      <body name="ankle" pos="0.2 0.1 0" quat="0.9 0.1 0.2 0.3">
        <joint name="roll" type="hinge" axis="1 0 0" pos="0.01 0.02 0" stiffness="3" springref="0.2"/>
        <joint name="pitch" type="hinge" axis="0 1 0" pos="0.01 0.02 0.01"/>
        <joint name="reach" type="slide" axis="0 0.6 0.8" stiffness="100" damping="2"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.1 0.2 -0.3" mass="0.7"/>
        <body name="foot" pos="0.1 0.2 -0.3">
          <joint name="ball" type="ball" pos="0 0 0.02" damping="0.02"/>
          <geom type="ellipsoid" size="0.1 0.05 0.02" pos="0.03 0 0" mass="0.4"/>
          <body name="claw" pos="0.1 0 0" euler="0 0.5 0"><geom type="sphere" size="0.02" mass="0.1"/></body>
        </body>
      </body>
      <body name="tail" pos="-0.2 0 0">
        <joint type="hinge" axis="0 0.3 1" range="-1 1" ref="0.4"/>
        <geom type="cylinder" size="0.02 0.1" mass="0.2" pos="-0.1 0 0" euler="0 1.5 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def _words(vector: np.ndarray) -> str:
    return " ".join(f"{each:.17g}" for each in vector)
