"""Making the stored reference of a case: routes are run, held against each other, and written with what is known."""
