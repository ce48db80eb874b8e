"""`python -m rebuild CASE`: each channel's distance to the reference, and its error bar."""

import sys

from .comparison import compare

for channel, (off, uncertainty) in compare(sys.argv[1]).items():
    print(f"{channel:40s} {off:9.1e} {'within' if off <= uncertainty else 'BEYOND'} {uncertainty:9.1e}")
