"""Stability maps: where a method or a motion holds and where it fails, beside the boundary that theory says.

A map is one case (a family of scenes with two parameters), one quantity and two named axes (`map`). Its cells are
refined where the class or the status changes (`refine`), run through the pool and recorded as they come (`run`),
compared with a theoretical or published boundary (`boundary`) and drawn (`picture`). `maps` has one small file for each
case.
"""
