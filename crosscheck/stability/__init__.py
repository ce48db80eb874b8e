"""Stability maps: where a motion is stable or a method works, compared with a theoretical boundary.

A map is a family of scenes with two parameters, one quantity and two named axes (`map`). Its cells are
refined where the class or the status changes (`refine`), run by a scheduler and recorded (`run`),
compared with a theoretical or published boundary (`boundary`) and drawn (`picture`). `maps` has one small file for each
case.
"""
