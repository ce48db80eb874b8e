"""Which model of every flexible body, and which method, are good enough for what the user wants to know?

`advise` answers with evidence. `quantity` says what the user cares about and measures its error. `models` and `ladder`
list the rungs of every body with their predicted error and cost. `modal_response`, `contribution` and `indicators`
predict, from one run of the rigid scene. `bench` and `confirm` run models and measure their error against the finest
models and their cost in operations. `search` walks the ladder. `advice_tables` prints the result in a terminal.
"""

from flexmb.advisor.advice import Advice as Advice
from flexmb.advisor.advice import advise as advise
