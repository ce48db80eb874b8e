"""Closed chains: a tree and closures on top of it, by the operational-space inertia of the closures' nodes.

The tree moves by the recursion of `flexmb.jain`. A closure suppresses relative motions of two ports; the loads that do
it follow from unit loads passed inward through the articulated quantities. `rows` says what a closure suppresses,
`groups` which closures feel each other's loads, so that all others are solved by themselves, `unit_loads` makes loads
on rows forces on the tree and passes these inward, `sizes` says what rows are compared with, `factor` finds the
independent ones, `clusters` couples groups that one base carries, `forces` adds the closure loads to an evaluation,
`projection` takes a state back to where the closures are closed, `branch` notices singular positions, `leap` passes
them, `dynamics` holds the entry points, `tangent` that of exact derivatives at given closure loads.
"""
