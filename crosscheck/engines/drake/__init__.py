"""Drake: rigid trees in minimal coordinates, integrated by Drake's own error-controlled Runge-Kutta methods."""

from crosscheck.engines.drake.engine import DrakeEngine as DrakeEngine
