"""A package, so that it is found before others of its name: dartpy's wheel, for one, brings a package `tests` along."""
