"""Output: folders and files that are written, and text that is shown."""
