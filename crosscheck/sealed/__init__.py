"""results.json: a session in one small file, sealed by its hash; what changed between two; a badge of one."""
