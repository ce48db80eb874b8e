"""Timing reports: who agrees is timed in turns (`bench`), and error against time over efforts (`chart`)."""
