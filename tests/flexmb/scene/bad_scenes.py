"""A scene with everything in it, and every way to spoil it: mutation, where, what, remedy."""

from __future__ import annotations

import numpy as np

from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.convert import to_struct
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.shapes import beam_section, cuboid_inertia

NAN = float("nan")
BALL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NONE = ((0.0, 0.0, 0.0),) * 3
TABLE = {"kind": "table", "times_s": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "values": [0.0, 0.1, 0.3, 0.6, 0.8, 0.9]}
PULSE = {"kind": "pulse", "value": 1.0, "start_s": 0.0, "duration_s": 1.0}
SINE = {"kind": "sine", "amplitude": 0.2, "angular_frequency_rad_s": 3.0}
SHAPE = np.array([[[0.0, 0.0], [0.1, 0.0], [0.0, 0.2]], [[0.0, 0.0], [0.4, 0.0], [0.0, 0.5]],
                  [[0.0, 0.0], [1.0, 0.0], [0.0, 0.9]]])  # fmt: skip


def satellite() -> SceneBuilder:
    """A hub (body 0), boom (1), bob (2), panel (3) and slider (4): every collection of a scene is in use."""
    section = beam_section(E=70e9, G=27e9, A=1e-3, Iy=1e-7, Iz=2e-7, rho=2700.0)
    flat = s.ModalNode(name="origin", position_m=(0, 0, 0), translation_modes=NONE[:2], rotation_modes=NONE[:2])
    edge = s.ModalNode(name="edge", position_m=(3, 0, 0), translation_modes=tuple(map(tuple, SHAPE[2].T)),
                       rotation_modes=NONE[:2])  # fmt: skip
    return (
        SceneBuilder("satellite")
        .rigid_body("hub", mass=10.0, inertia=cuboid_inertia(10.0, (1.0, 1.0, 1.0)), nodes={"flange": (0.5, 0, 0)})
        .beam("boom", length=3.0, elements=4, section=section, modes=3, nodes={"middle": 1.5})
        .rigid_body("bob", mass=2.0, inertia=BALL)
        .modal_body("panel", points=inertia_points(np.ones(3), np.arange(1.0, 4.0)[:, None] * (1, 0, 0), SHAPE),
                    stiffness=np.diag([50.0, 80.0]), nodes=[flat, edge])
        .rigid_body("slider", mass=1.0, inertia=BALL)
        .free("base", "ground", "hub")
        .revolute("root", "hub", "boom", parent_node="flange", prescribed=to_struct(TABLE, s.Table))
        .gimbal("cardan", "boom", "bob", parent_node="tip", sequence="zx", rotations=[angular(stiffness=1.0),
                angular()])
        .weld("mount", "hub", "panel")
        .prismatic("rail", "hub", "slider", force=to_struct(SINE, s.Sine), damping=0.1)
        .wheel("spinner", "hub", axis=(0, 0, 1), mass=1.0, axial_inertia=0.1, transverse_inertia=0.06, speed=100.0)
        .point_mass("fuel", "bob", mass=0.5, directions=[(1, 0, 0), (0, 1, 0)], coordinates=[linear(), linear()])
        .force("thruster", "hub", direction=(1, 0, 0), function=to_struct(PULSE, s.Pulse))
        .marker("eye", "boom", node="tip")
        .modal_state("boom", coordinates=(0.01, 0.0, 0.0))
        .closure("loop", "spherical", "bob", "slider")
        .coupling("gear", "rail", {("cardan", "rotations[1]"): 0.2}, offset=0.1)
    )  # fmt: skip


def put(*path_and_value):
    """A mutation that sets data[path] = value."""
    *path, last, value = path_and_value

    def mutate(data):
        for step in path:
            data = data[step]
        data[last] = value

    return mutate


def append(collection, **item):
    return lambda data: data[collection].append(item)


def drop(collection, index):
    return lambda data: data[collection].pop(index)


def both(*mutations):
    def mutate(data):
        for mutation in mutations:
            mutation(data)

    return mutate


MASSLESS = {"kind": "rigid", "name": "ghost", "mass_kg": 0.0, "inertia_kg_m2": NONE}
POINT = {"kind": "rigid", "name": "ghost", "mass_kg": 1.0, "inertia_kg_m2": NONE}


def hang(body, kind, **more):
    """Add a body by a hinge of a kind."""
    hinge = {"kind": kind, "name": "extra", "parent": "hub", "child": "ghost"} | more
    return both(append("bodies", **body), append("hinges", **hinge))


STATION = ("bodies", 1, "stations", 1)
MODES = ("bodies", 1, "modes")
STATELESS = put("modal_states", [])
LUMP = {"x_m": 3.0, "mass_kg": 1.0, "inertia_kg_m2": NONE}

# name: (mutation, fragments of where, fragments of what, fragments of the remedy)
BAD = {
    # names and references
    "duplicate body": (append("bodies", kind="rigid", name="bob", mass_kg=1.0, inertia_kg_m2=BALL),
                       ["$.bodies[5].name"],
                       ["duplicate", "$.bodies[2]"], ["rename"]),
    "duplicate hinge": (put("hinges", 1, "name", "base"), ["$.hinges[1]"], ["duplicate"], ["rename"]),
    "wheel named like a hinge": (put("wheels", 0, "name", "base"), ["$.wheels[0]"], ["$.hinges[0]"], ["rename"]),
    "duplicate marker": (append("markers", name="eye", body="hub"), ["$.markers[1]"], ["duplicate"], ["rename"]),
    "duplicate node": (put("bodies", 0, "nodes", [{"name": "flange"}, {"name": "flange"}]),
                       ["$.bodies[0].nodes[1]"], ["duplicate"], ["rename"]),
    "reserved node": (put("bodies", 1, "nodes", 0, "name", "tip"), ["$.bodies[1].nodes[0]", 'body "boom"'],
                      ["without being listed"], ["rename"]),
    "body named ground": (append("bodies", kind="rigid", name="ground", mass_kg=1.0, inertia_kg_m2=BALL),
                          ["$.bodies[5]"],
                          ["inertial frame"], ["rename"]),
    "empty name": (put("markers", 0, "name", " "), ["$.markers[0].name"], ["not a name"], ["printable"]),
    "unknown parent": (put("hinges", 3, "parent", "hubb"), ["$.hinges[3].parent", 'hinge "mount"'], ['"hubb"'],
                       ['"hub"']),
    "unknown child": (put("hinges", 3, "child", "pannel"), ["$.hinges[3].child"], ['"pannel"'], ['"panel"']),
    "ground as child": (put("hinges", 3, "child", "ground"), ["$.hinges[3].child"], ["ground"], ["name a body"]),
    "unknown body of a load": (put("loads", 0, "body", "hop"), ["$.loads[0].body"], ['"hop"'], ["hub"]),
    "unknown node": (put("hinges", 1, "parent_node", "flannel"), ["$.hinges[1].parent_node"], ['"flannel"'],
                     ["flange"]),
    "unknown node of a marker": (put("markers", 0, "node", "tipp"), ["$.markers[0].node"], ["boom"], ['"tip"']),
    "node of the ground": (put("hinges", 0, "parent_node", "pad"), ["$.hinges[0].parent_node"], ["ground"], ["offset"]),
    "free-free modal body without origin": (
        both(put("bodies", 3, "boundary", "free-free"), lambda data: data["bodies"][3]["nodes"].pop(0)),
        ["$.hinges[3].child_node"], ["origin"], ["list it"]),
    "closure to an unknown body": (put("closures", 0, "body_b", "slid"), ["$.closures[0].body_b"], [], ["slider"]),
    "closure of a body with itself": (put("closures", 0, "body_b", "bob"), ["$.closures[0]"], ["itself"],
                                      ["different"]),
    "closure named like a hinge": (put("closures", 0, "name", "rail"), ["$.closures[0].name"], ['"rail"'], ["rename"]),
    "closure at a node of the ground": (
        both(put("closures", 0, "body_b", "ground"), put("closures", 0, "node_b", "pad")), ["$.closures[0].node_b"],
        ["ground"], ["offset"]),
    "closure with a quaternion that is none": (put("closures", 0, "quaternion_b", [1.0, 1.0, 0.0, 0.0]),
                                               ["$.closures[0].quaternion_b"], ["unit"], []),
    "closure without an axis": (put("closures", 0, "axis", [1.0, 0.0, 0.0]), ["$.closures[0].axis"],
                                ["spherical closure has no axis"], ["quaternion_a"]),
    "closure with a zero axis": (
        both(put("closures", 0, "type", "revolute"), put("closures", 0, "axis", [0.0, 0.0, 0.0])),
        ["$.closures[0].axis"], ["zero"], ["unit vector"]),
    # couplings
    "coupling of an unknown hinge": (put("couplings", 0, "hinge", "rial"), ["$.couplings[0]", 'coupling "gear"'],
                                     ['no hinge "rial"'], ["name a hinge"]),
    "coupling of a free hinge": (put("couplings", 0, "hinge", "base"), ["$.couplings[0]"],
                                 ['hinge "base" of type free has no scalar coordinate'], ["angles or displacements"]),
    "coupling of one of two": (put("couplings", 0, "terms", 0, "coordinate", ""), ["$.couplings[0]"],
                               ["more than one coordinate, rotations[0], rotations[1]"], ["name a hinge"]),
    "coupling of a third of two": (put("couplings", 0, "terms", 0, "coordinate", "rotations[2]"), ["$.couplings[0]"],
                                   ['no coordinate "rotations[2]"', "rotations[0], rotations[1]"], ["name a hinge"]),
    "coupling without ratio": (put("couplings", 0, "terms", 0, "ratio", 0.0), ["$.couplings[0].terms[0].ratio"],
                               ["zero"], ["leave"]),
    "coupling with itself": (put("couplings", 0, "terms", [{"hinge": "rail", "ratio": 0.5}]), ["$.couplings[0]"],
                             ['"translation" of hinge "rail" is named twice'], ["once"]),
    "coupling of nothing": (put("couplings", 0, "terms", []), ["$.couplings[0].terms"], ["no coordinate leads"],
                            ["prescribed, or a weld"]),
    "coupling of what is prescribed": (
        both(put("couplings", 0, "hinge", "root"), put("couplings", 0, "terms", [{"hinge": "rail", "ratio": 1.0}]),
             put("hinges", 4, "translation", {"prescribed_m": {"kind": "constant", "value": 0.0}})),
        ["$.couplings[0]"], ["all its coordinates are prescribed"], ["leave the coupling out"]),
    "coupling named like a closure": (put("couplings", 0, "name", "loop"), ["$.couplings[0].name"], ['"loop"'],
                                      ["rename"]),
    # the tree
    "cycle": (put("hinges", 0, "parent", "bob"), ["$.hinges"], ["cycle", "boom -> bob -> hub -> boom"], ["ground"]),
    "self hinge": (put("hinges", 4, "parent", "slider"), ["$.hinges[4]", 'hinge "rail"'], ["itself"], ["different"]),
    "body without hinge": (both(drop("hinges", 4), put("couplings", [])), ["$.bodies[4]", 'body "slider"'],
                           ["not the child"], ["free hinge"]),
    "two inboard hinges": (append("hinges", kind="weld", name="again", parent="bob", child="slider"), ["$.hinges[5]"],
                           ['"again"', '"slider"', '"rail"'], ["closure"]),
    "no bodies": (both(put("bodies", []), *(put(key, []) for key in (
        "hinges", "wheels", "point_masses", "loads", "markers", "modal_states", "closures", "couplings"))),
        ["$.bodies"], ["no body"], ["add"]),
    # numbers
    "NaN": (put("bodies", 0, "com_m", 1, NAN), ["$.bodies[0].com_m[1]", 'body "hub"'], ["nan"], ["finite"]),
    "unnormalised quaternion": (put("hinges", 1, "child_quaternion", [1.0, 0.0, 0.0, 0.1]),
                                ["$.hinges[1].child_quaternion"], ["norm is 1.00"], ["write (0.99"]),
    "zero quaternion": (put("bodies", 0, "nodes", 0, "quaternion", [0.0] * 4),
                        ["$.bodies[0].nodes[0].quaternion", 'node "flange"'], ["zero"], ["(1, 0, 0, 0)"]),
    "zero axis": (put("hinges", 4, "axis", [0.0] * 3), ["$.hinges[4].axis"], ["zero"], ["unit vector"]),
    "axis not a unit vector": (put("wheels", 0, "axis", [0.0, 3.0, 4.0]), ["$.wheels[0].axis"], ["length is 5"],
                               ["(0.0, 0.6, 0.8)"]),
    # rigid bodies
    "inertia without mass": (put("bodies", 2, "mass_kg", 0.0), ["$.bodies[2].mass_kg"], ["inertia"], ["give its mass"]),
    "unsymmetric inertia": (put("bodies", 2, "inertia_kg_m2", 0, 1, 0.1), ["$.bodies[2].inertia_kg_m2"],
                            ["not symmetric", "[0][1]"], ["both sides"]),
    "indefinite inertia": (put("bodies", 2, "inertia_kg_m2", [[1, 2, 0], [2, 1, 0], [0, 0, 1]]),
                           ["$.bodies[2].inertia_kg_m2"], ["not positive semidefinite"], ["signs"]),
    "triangle inequality": (put("bodies", 2, "inertia_kg_m2", 2, 2, 2.1), ["$.bodies[2].inertia_kg_m2"],
                            ["triangle", "2.1"], ["add up"]),
    # beams
    "no elements": (put("bodies", 1, "elements", 0), ["$.bodies[1].elements"], ["0 elements"], ["one"]),
    "elements that memory cannot hold": (put("bodies", 1, "elements", 5000), ["$.bodies[1].elements", '"boom"'],
                                         ["5000 elements and 3 modes", "GiB and"], ["give 200 or fewer"]),
    "elements beyond all numbers": (put("bodies", 1, "elements", 2**62), ["$.bodies[1].elements"], ["GiB"], ["fewer"]),
    "elements of 400 digits": (put("bodies", 1, "elements", 10**400), ["$.bodies[1].elements"], ["GiB"], ["fewer"]),
    "modes that memory cannot hold": (
        both(put("bodies", 1, "elements", 200), put("bodies", 1, "level", "linear"), put(*MODES, "count", 400),
             STATELESS),
        ["$.bodies[1].elements"], ["400 modes", "GiB"], ["as few modes"]),
    "no length": (both(put("bodies", 1, "length_m", 0.0), put("bodies", 1, "nodes", []), put(*STATION, "x_m", 0.0)),
                  ["$.bodies[1].length_m"], ["length is 0"], ["positive"]),
    "stations short of the tip": (put(*STATION, "x_m", 2.5), ["$.bodies[1].stations"], ["2.5"], ["x_m = 3.0"]),
    "unsorted stations": (lambda data: data["bodies"][1]["stations"].reverse(), ["$.bodies[1].stations"],
                          ["order"], ["sort"]),
    "Timoshenko without shear stiffness": (both(put("bodies", 1, "theory", "timoshenko"), put(*STATION, "GAy_N", None)),
                                           ["$.bodies[1].stations[1]"], ["GAy_N"], ["euler-bernoulli"]),
    "node off the beam": (put("bodies", 1, "nodes", 0, "x_m", 3.5), ["nodes[0].x_m"], ["3.5"], ["<= 3"]),
    "tip mass off the beam": (put("bodies", 1, "tip_masses", [LUMP | {"x_m": -1.0}]), ["tip_masses[0].x_m"], [],
                              ["<= 3"]),
    "impossible tip inertia": (put("bodies", 1, "tip_masses", [LUMP | {"inertia_kg_m2": np.diag([1, 1, 3]).tolist()}]),
                               ["tip_masses[0].inertia_kg_m2"], ["triangle"], ["add up"]),
    "no modes": (both(put(*MODES, "count", 0), STATELESS), ["$.bodies[1].modes.count"], ["0 modes"], ["rigid"]),
    "more modes than coordinates": (both(put(*MODES, "count", 25), STATELESS), ["modes.count"], ["25", "24"],
                                    ["more elements"]),
    "repeated family": (put(*MODES, "families", ["axial", "bending_y", "axial"]), ["modes.families"], [], ["once"]),
    "damping ratios do not match": (put(*MODES, "damping_ratio", [0.01, 0.02]), ["modes.damping_ratio"],
                                    ["2 damping ratios for 3"], ["one for each"]),
    # raw modal bodies
    "neither points nor file": (put("bodies", 3, "points", []), ["$.bodies[3]"], ["neither"], ["npz"]),
    "points and file": (put("bodies", 3, "file", "panel.npz"), ["$.bodies[3]"], ["both"], [".npz"]),
    "file missing": (both(put("bodies", 3, "points", []), put("bodies", 3, "file", "nowhere.npz")),
                     ["$.bodies[3].file", 'body "panel"'], ["nowhere.npz"], ["beside the scene"]),
    "shapes do not match": (lambda data: data["bodies"][3]["points"][1]["translation_modes"].pop(),
                            ["$.bodies[3].points"], ["1 modes", "2"], ["shapes"]),
    "stiffness of the wrong size": (put("bodies", 3, "stiffness", [[1.0]]), ["$.bodies[3]"], ["(1, 1)", "(2, 2)"],
                                    ["shap"]),
    "no stiffness": (put("bodies", 3, "stiffness", []), ["$.bodies[3].stiffness"], ["no stiffness"], ["2 x 2"]),
    "unsymmetric stiffness": (put("bodies", 3, "stiffness", 0, 1, 5.0), ["$.bodies[3].stiffness"], ["not symmetric"],
                              ["sym"]),
    "negative point mass": (put("bodies", 3, "points", 2, "mass_kg", -0.1), ["points[2]"], ["negative"], ["zero"]),
    "impossible point inertia": (put("bodies", 3, "points", 2, "inertia_kg_m2", np.diag([1, 1, 3]).tolist()),
                                 ["points[2]"], ["triangle"], ["add up"]),
    "modal node with too few shapes": (put("bodies", 3, "nodes", 1, "rotation_modes", [[0.0, 0.0, 0.0]]),
                                       ["$.bodies[3].nodes[1].rotation_modes", '"edge"'], ["1 shapes for 2"],
                                       ["each mode"]),
    "rigid-body content at the clamp": (put("bodies", 3, "nodes", 0, "translation_modes", 1, 2, 0.1),
                                        ["$.bodies[3].nodes[0]"], ["mode 1 moves the clamp"], ["subtract"]),
    "moving point at the clamp": (put("bodies", 3, "points", 0, "position_m", [0.0, 0.0, 0.0]), ["points[0]"],
                                  ["mode 0 moves the clamp"], ["free-free"]),
    "dependent modes": (lambda data: [p["translation_modes"].__setitem__(1, p["translation_modes"][0])
                                      for p in data["bodies"][3]["points"]],
                        ["$.bodies[3]"], ["not independent"], ["drop"]),
    "mode that moves no mass": (lambda data: [p["translation_modes"].__setitem__(1, [0.0, 0.0, 0.0])
                                              for p in data["bodies"][3]["points"]],
                                ["$.bodies[3]"], ["mode 1 moves no mass"], ["leave"]),
    "rigid-body motion among free-free modes": (
        both(put("bodies", 3, "boundary", "free-free"),
             lambda data: [p["translation_modes"].__setitem__(0,
             [0.0, 1.0, 0.0]) for p in data["bodies"][3]["points"]]),
        ["$.bodies[3]"], ["rigid-body motion"], ["remove"]),
    "rigid-body motion that no clamp holds": (
        both(put("bodies", 3, "stiffness", [[0.0, 0.0], [0.0, 80.0]]),
             lambda data: [p["translation_modes"].__setitem__(0, [0.0, p["position_m"][0], 0.0])
                           for p in data["bodies"][3]["points"]]),
        ["$.bodies[3]"], ["clamped modes", "without strain energy"], ["remove"]),
    "modal state of a rigid body": (put("modal_states", 0, "body", "hub"), ["$.modal_states[0].body"], ["rigid"],
                                    ["leave"]),
    "modal state of the wrong length": (put("modal_states", 0, "coordinates", [0.1]), ["modal_states[0].coordinates"],
                                        ["1 modal coordinates for the 3"], ["3 values"]),
    "modal state given twice": (append("modal_states", body="boom", coordinates=[0.0] * 3), ["$.modal_states[1]"],
                                ["already given"], ["merge"]),
    # total loads
    "total load of no joint": (append("total_loads", name="sum", joints=[], body="hub"),
                               ["$.total_loads[0].joints", 'total load "sum"'], ["no joints"], ["name the hinges"]),
    "total load of a joint that is not there": (append("total_loads", name="sum", joints=["raill"], body="slider"),
                                                ["$.total_loads[0].joints[0]"], ['"raill"'], ["rail"]),
    "total load of a joint twice": (append("total_loads", name="sum", joints=["rail", "rail"], body="slider"),
                                    ["$.total_loads[0].joints[1]"], ["twice"], ["once"]),
    "total load on another body": (append("total_loads", name="sum", joints=["rail"], body="boom"),
                                   ["$.total_loads[0].joints[0]"], ['"rail" joins', '"boom"'], ["leave the joint out"]),
    "total load about no node": (append("total_loads", name="sum", joints=["rail"], body="slider", node="top"),
                                 ["$.total_loads[0].node"], ['no node "top"'], [""]),
    "total load with a hinge's name": (append("total_loads", name="rail", joints=["rail"], body="slider"),
                                       ["$.total_loads[0].name"], ['duplicate name "rail"'], ["rename"]),
    # hinges, wheels, point masses
    "gimbal axis unknown": (put("hinges", 2, "sequence", "zq"), ["$.hinges[2].sequence"], ['"zq"'], ["zxz"]),
    "gimbal axis repeated": (put("hinges", 2, "sequence", "zz"), ["$.hinges[2].sequence"], ["repeats"], ["differ"]),
    "gimbal rotations do not match": (put("hinges", 2, "sequence", "zxz"), ["$.hinges[2].rotations"],
                                      ["2 rotations for the 3"], ["each axis"]),
    "motor on a prescribed hinge": (put("hinges", 1, "rotation", "torque_Nm", SINE), ["$.hinges[1].rotation.torque_Nm"],
                                    ["prescribed"], ["drive load"]),
    "start against the profile": (put("hinges", 1, "rotation", "angle_rad", 0.2), ["$.hinges[1].rotation.angle_rad"],
                                  ["starts at 0.2", "at 0"], ["leave angle_rad out"]),
    "wheel start against the profile": (put("wheels", 0, "prescribed_rad", SINE), ["$.wheels[0].speed_rad_s"],
                                        ["starts at 100", "0.6"], ["leave speed_rad_s out"]),
    "pulse as a motion": (put("hinges", 1, "rotation", "prescribed_rad", PULSE),
                          ["$.hinges[1].rotation.prescribed_rad"],
                          ["jumps"], ["smooth_step"]),
    "impossible wheel": (put("wheels", 0, "transverse_inertia_kg_m2", 0.04), ["transverse_inertia_kg_m2", "spinner"],
                         ["twice"], ["0.05"]),
    "directions not orthogonal": (put("point_masses", 0, "directions", 1, [0.6, 0.8, 0.0]),
                                  ["$.point_masses[0].directions"],
                                  ["not orthogonal"], ["orthonormal"]),
    "left-handed directions": (
        both(put("point_masses", 0, "directions", [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
             put("point_masses", 0, "coordinates", [])),
        ["$.point_masses[0].directions"], ["left-handed"], ["swap"]),
    "coordinates do not match": (put("point_masses", 0, "coordinates", [{}]), ["$.point_masses[0].coordinates"],
                                 ["1 coordinates for 2"], ["each direction"]),
    # functions of time
    "profile does not cover the run": (put("hinges", 1, "rotation", "prescribed_rad", "times_s", [0, 1, 2, 3, 4, 4.5]),
                                       ["prescribed_rad.times_s"], ["0 s to 4.5 s", "5 s"], ["extend"]),
    "profile begins late": (put("hinges", 1, "rotation", "prescribed_rad", "times_s", [1, 2, 3, 4, 5, 6]),
                            ["prescribed_rad.times_s"], ["1 s to 6 s"], ["extend"]),
    "table not increasing": (put("hinges", 1, "rotation", "prescribed_rad", "times_s", [0, 1, 3, 3, 4, 5]),
                             ["prescribed_rad.times_s[3]"], ["do not increase"], ["sort"]),
    "table too short": (put("loads", 0, "function", TABLE | {"times_s": [0, 5], "values": [0, 1]}),
                        ["$.loads[0].function.times_s"], ["only 2"], ["6 samples"]),
    "table values do not match": (put("loads", 0, "function", TABLE | {"values": [0.0]}),
                                  ["$.loads[0].function.values"],
                                  ["6 times but 1 values"], ["each time"]),
    # inertia beyond hinges
    "massless tip": (hang(MASSLESS, "revolute"), ['hinge "extra"'], ['"ghost"', "inertia about"],
                     ["weld", "prescribe"]),
    "point mass on its own axis": (hang(POINT, "revolute"), ['hinge "extra"'], ["inertia about"],
                                   ["give them inertia"]),
    "point mass on a spherical hinge": (hang(POINT, "spherical"), ['hinge "extra"'], ["inertia about"], ["weld"]),
    "point mass off the origin of a free hinge": (
        hang(POINT | {"com_m": [1.0, 2.0, 3.0]}, "free"), ['hinge "extra"'], ["inertia about"], ["give them inertia"]),
    "massless slider": (hang(MASSLESS, "prismatic"), ['hinge "extra"'], ["mass along"], ["give them mass"]),
    "free rod without inertia about itself": (
        both(hang(POINT | {"inertia_kg_m2": np.diag([0.0, 1.0, 1.0]).tolist()}, "free")),
        ['hinge "extra"'], ["inertia about"], ["give them inertia"]),
    "gimbal lock at the start": (
        hang(POINT | {"inertia_kg_m2": BALL}, "gimbal", sequence="zxz", rotations=[{}, {}, {}]),
        ['hinge "extra"'], ["gimbal lock"], ["another sequence"]),
    "gimbal lock at the start, a hinge beyond": (
        both(put("hinges", 2, "sequence", "zxz"), put("hinges", 2, "rotations", [{}, {}, {}]),
             hang(POINT | {"inertia_kg_m2": BALL}, "revolute", parent="bob")),
        ['hinge "cardan"'], ["gimbal lock"], ["spherical"]),
}  # fmt: skip

# A body that lost its hinge to a wrong name is itself reported too.
ORPHANING = ("unknown child", "ground as child", "body named ground")

_COIL = both(STATELESS, put("bodies", 1, "level", "exact"), put(*MODES, "families", ["bending_z"]),
             put(*STATION, "curvature_1_m", [0.0, 0.0, 20.0 / 3.0]))  # fmt: skip

# What a sound scene may have and few do; last the word that waives it.
DOUBTFUL = {
    "stiffness in kN": (put(*STATION, "EA_N", 70e9), ["stations[1].EA_N"], ["waves"], ["1000", "units"], "wave_speed"),
    "modulus in MPa": (put(*STATION, "EA_N", 70.0), ["stations[1].EA_N"], ["waves"], ["units"], "wave_speed"),
    "bending stiffness in N mm2": (put(*STATION, "EIz_Nm2", 14e9), ["stations[1].EIz_Nm2"], ["gyration"], ["units"],
                                   "thick_section"),
    "torsion stiffness off by 1000": (put(*STATION, "GJ_Nm2", 8.1e6), ["stations[1].GJ_Nm2"], ["386 times"],
                                      ["units"], "shear_stiffness"),
    "shear stiffness off by 1000": (put(*STATION, "GAz_N", 22.5e9), ["stations[1].GAz_N"], ["321 times"], ["units"],
                                    "shear_stiffness"),
    "elements that change no digit": (put("bodies", 1, "elements", 201), ["$.bodies[1].elements", '"boom"'],
                                      ["201 elements for 3 modes", "GiB"], ["200 or fewer"], "many_elements"),
    "modal stiffness off by 1e12": (put("bodies", 3, "stiffness", [[50e12, 0.0], [0.0, 80e12]]),
                                    ["$.bodies[3].stiffness"], ["Hz"], ["units"], "modal_frequency"),
    "negative damping ratio": (put(*MODES, "damping_ratio", -0.01), ["modes.damping_ratio"], ["negative"], ["zero"],
                               "negative_damping"),
    "damping that drives": (put("bodies", 3, "damping", [[1.0, 0.0], [0.0, -1.0]]), ["$.bodies[3].damping"],
                            ["indefinite"], ["sign"], "negative_damping"),
    "friction smoothed away": (
        put("connectors", [{"kind": "angular_friction", "name": "rub", "hinge": "root", "sliding_Nm": 1.0,
                            "static_Nm": 1.5, "stribeck_rad_s": 0.05, "smoothing_rad_s": 0.01}]),
        ["$.connectors[0]"], ["86.7%", "runs away"], ["smoothing of"], "friction_peak"),
    "indefinite stiffness": (put("bodies", 3, "stiffness", 1, 1, -80.0), ["$.bodies[3].stiffness"], ["indefinite"],
                             ["sign"], "negative_stiffness"),
    "negative stiffness": (put("hinges", 2, "rotations", 0, "stiffness_Nm_rad", -1.0),
                           ["$.hinges[2].rotations[0].stiffness_Nm_rad", '"cardan"'], ["negative stiffness"], ["zero"],
                           "negative_stiffness"),
    "a port inside a piece": (
        both(put("bodies", 1, "level", "exact"), put(*MODES, "families", ["bending_y"]),
             put(*MODES, "cuts", []), put("hinges", 2, "parent_node", "middle")),
        ["$.bodies[1].modes.cuts", 'body "boom"'], ["strains jump at x = 1.5 m", 'hinge "cardan" at node "middle"'],
        ["cut the beam there"], "uncut_beam"),
    "a coil with few points": (
        both(_COIL, put(*MODES, "count", 14), put(*MODES, "points", 15)),
        ["$.bodies[1].modes.points", 'body "boom"'], ["turns by 20 rad", "15 points"], ["points = 20"], "few_points"),
    "a coil with few polynomials": (
        _COIL, ["$.bodies[1].modes.count", 'body "boom"'], ["turns by 20 rad", "3 polynomials"], ["count = 17"],
        "few_polynomials"),
}  # fmt: skip
