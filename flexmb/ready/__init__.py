"""Compilation of the general kernels when flexmb is installed.

scenes.py  small scenes that together reach every kernel
uses.py    calls on these scenes that together compile every kernel
make.py    runs the uses in several processes: `python -m flexmb.ready.make FOLDER`

A general kernel runs every scene, so that one set of them serves all users. Special kernels, for the features of one
scene, are faster by a tenth to a third and take seconds to compile. flexmb/jit/cache.py finds both.
"""
