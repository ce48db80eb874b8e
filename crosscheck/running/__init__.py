"""Running cases: the jobs of a case (`plan`), one job in a worker (`execute`), many in a pool (`sweep`)."""
