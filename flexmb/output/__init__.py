"""Output: writing files and folders safely, and printing text."""
