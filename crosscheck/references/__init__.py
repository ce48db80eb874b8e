"""Making the stored reference of a case: routes are run, compared, and written with their uncertainties."""
