"""On the way out: folders and files that are written, text that is shown."""
