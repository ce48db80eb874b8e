"""Scenes as programs without Python: FMUs and C (docs/export-fmu.md).

refusals.py     what cannot be exported, by name with the remedy, before anything is compiled
entry.py        the compiled functions: rates, outputs, states put back on their manifold
emitted.py      these and all kernels that they reach as one object file
image.py        the tables of a system as one block of memory, with the places of its addresses
numbers.py      numbers of a scene that are changed by writing into that block: inputs and parameters
model.py        all of these together, with names and units: what is exported
sources.py      a model as C: header, tables, example
description.py  a model as `modelDescription.xml` of FMI 2.0 or 3.0
writing.py      `export_fmu` and `export_c`: the archive, or the folder of sources
web.py          `export_page`: a page that computes the model, by WebAssembly
c/              what is the same for all models
"""
