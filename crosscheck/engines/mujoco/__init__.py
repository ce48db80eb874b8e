"""MuJoCo: rigid trees in minimal coordinates, fixed-step RK4."""

from crosscheck.engines.mujoco.engine import MujocoEngine as MujocoEngine
