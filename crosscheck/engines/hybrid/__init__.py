"""Events and controllers of a scene in the loop of a peer, written from the scene's data alone.

None of flexmb's events, controllers and laws is used here: what a latch, a sample or a filter does is written once
more, so that a scene with them is judged by a second code. A peer gives its accelerations and its mass matrix
(`hybrid.phase.PeerMechanics`); instants, crossings, impulses and the states of controllers are those of the loop.
"""
