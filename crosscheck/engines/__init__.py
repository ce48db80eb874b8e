"""What an engine must offer (`contract`), which engines there are (`registry`), and one adapter for each code."""
