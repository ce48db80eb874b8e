"""The case library: what a case says (`case`), its rules (`check`), finding cases, and what of them is run."""
