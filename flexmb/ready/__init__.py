"""General kernels, compiled before anybody needs them: when flexmb is installed.

scenes.py  small scenes that between them reach every kernel
uses.py    what is asked of them
make.py    several processes that ask it, into a folder: `python -m flexmb.ready.make FOLDER`

Kernels of what a user's scene contains are faster by some tenths and take seconds to compile; a general kernel takes
every scene, so one set serves all. flexmb/jit/cache.py finds them beside what users compile themselves.
"""
