"""`python -m rebuild CASE`: each channel's distance to the reference, and its error bar."""

import sys

from .comparison import compare

try:
    found = compare(sys.argv[1])
except ArithmeticError as error:
    sys.exit(f"{sys.argv[1]}: {error}")
for channel, (off, uncertainty) in found.items():
    print(f"{channel:40s} {off:9.1e} {'within' if off <= uncertainty else 'BEYOND'} {uncertainty:9.1e}")
