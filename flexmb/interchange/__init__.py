"""Exchange with other programs: SID files, finite-element matrices, robot descriptions. Nothing here knows dynamics."""
