"""Timing reports: rivals that agree take turns on one scene (`bench`), and error against time over efforts (`chart`)."""
