"""Timing reports: engines that agree are timed in turns (`bench`); error against time over efforts (`chart`)."""
