"""Exchange with other programs: SID files, finite-element matrices, robot descriptions; without any dynamics."""
