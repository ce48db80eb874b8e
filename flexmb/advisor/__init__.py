"""Selection of the cheapest model of every flexible body, and method, that give a quantity to a tolerance.

The candidate models of a body are its *ladder*, one model is a *rung*. `advise` selects with evidence. `quantity`
defines what is measured, and its error. `models` and `ladder` list the rungs of every body with predicted error and
cost. `modal_response`, `contribution` and `indicators` predict from one run of the rigid scene. `bench` and `confirm`
run models, and measure their error against the finest models and their cost in operations. `search` looks for the
cheapest adequate combination. `advice_tables` prints the result in a terminal.
"""

from flexmb.advisor.advice import Advice as Advice
from flexmb.advisor.advice import advise as advise
