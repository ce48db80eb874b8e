"""Closed chains: a tree with closures and couplings, solved by the operational-space inertia of the closure nodes.

The tree is evaluated by the recursion of `flexmb.jain`. A closure constrains the relative motion of two ports (a frame
on each of two bodies); each suppressed motion is a row of the constraint Jacobian. The constraint loads follow from
unit loads that are propagated inward through the articulated-body quantities.

- `rows`: value, rate and acceleration of each constraint row
- `couplings`: the same of linear relations of coordinates
- `groups`: which loops are dynamically coupled; independent groups are solved separately
- `unit_loads`: response of the tree to a unit load on each row
- `sizes`: reference magnitudes for the rank decision
- `factor`: rank-revealing factorisation
- `clusters`: coupling of groups that are carried by the same base
- `forces`: adds the constraint loads to an evaluation
- `projection`: projects a state onto the constraint manifold
- `branch`: detects singular positions; `leap` passes them
- `dynamics`: entry points; `tangent`: exact derivatives at given constraint loads
"""
