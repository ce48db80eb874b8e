"""The label of a case: its credibility by the factors of NASA-STD-7009B, each with the files that stand behind it.

A level is computed from evidence on file and can be stated nowhere by hand: `factors` has the criteria, `evidence`
reads the files and finds out whether they are about this case and this code, `ladder` has the rules, and `document`
writes `label.json`, which nothing reads.
"""
