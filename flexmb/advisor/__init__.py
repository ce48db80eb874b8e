"""Which model of every flexible body, and which method, are good enough for what the user wants to know?

`advise` answers with evidence. `quantity`: what matters, and its error. `models`, `ladder`: the rungs of every body,
scene to scene, with predicted error and cost. `modal_response`, `contribution`, `indicators`: the predictions, from
one run of the rigid scene. `bench`, `confirm`: runs, their errors against the finest models, their counted cost.
`search`: the walk. `advice_tables`: all that in a terminal.
"""

from flexmb.advisor.advice import Advice as Advice
from flexmb.advisor.advice import advise as advise
