"""results.json: a session in one small file with its own hash; differences of two such files; badges."""
