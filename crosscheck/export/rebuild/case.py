"""The equations of motion of a case, and what is observed."""

from os.path import isfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from .forms import MODAL, MODEL, read_json
from .frame import JacobianFrame, field
from .functions import breaks_of, function_of
from .rotations import cross, matrix_of, quaternion_of, quaternion_rate, rotation_vector, skew, turn, turned_by


def read_case(folder):
    """The equations of motion of the exported case in a folder; SystemExit names a file that is none, and why."""
    folder = Path(folder)
    file, modal = folder / "model.json", {}
    data = read_json(file, MODEL)
    for body in data["bodies"]:
        if body["kind"] == "modal":
            place = folder / body["file"]
            if not isfile(place):
                raise SystemExit(f'{file}: the file of body "{body["name"]}" is not there: {place}')
            modal[body["name"]] = read_json(place, MODAL)
    try:
        return RebuiltCase(data, modal)
    except (ValueError, ArithmeticError) as error:
        raise SystemExit(f"{file}: {error}") from None


class RebuiltCase:
    """The equations of motion of one exported case. The state y is [q, u]; a quaternion has four of q, three of u.

    `data` is the content of `model.json`, `modal` that of `modal/<body>.json` by the name of each flexible body.
    ValueError where they do not fit each other.
    """

    def __init__(self, data, modal):
        for part in ("beams", "closures", "connectors", "controllers", "events"):
            if data[part]:
                raise SystemExit(f"{data['name']}: it has {part}, which this program does not rebuild")
        self.data, self.gravity = data, np.array(data["gravity_m_s2"])
        self.bodies = {body["name"]: body for body in data["bodies"]}
        self.modal = {name: _flexible(body) for name, body in modal.items()}
        self._check()
        self.joints = self._ordered(data["joints"])
        self._number()
        self.loads = [(load, function_of(load["function"])) for load in data["loads"]]
        if not np.all(np.isfinite(self.rates(0.0, self.start))):
            raise ValueError("its accelerations at the start are not finite")

    def _check(self):
        """ValueError unless each body has one joint, and all else is at nodes and bodies that there are."""
        bodies, joints = [body["name"] for body in self.data["bodies"]], self.data["joints"]
        children = [joint["child"] for joint in joints]
        if sorted(children) != sorted(bodies) or len({*bodies, "ground"}) <= len(bodies):
            raise ValueError("each body has one name and one joint")
        if len({joint["name"] for joint in joints}) < len(joints):
            raise ValueError("two joints have one name")
        nodes = {name: {"origin", *body.get("nodes", ())} for name, body in self.bodies.items()}
        nodes |= {name: set(modal["nodes"]) for name, modal in self.modal.items()} | {"ground": {"origin"}}
        places = [(joint[end], joint[f"{end}_node"]) for joint in joints for end in ("parent", "child")]
        places += [
            (item_of_case["body"], item_of_case["node"])
            for part in ("loads", "markers")
            for item_of_case in self.data[part]
        ]
        for body, node in places:
            if node not in nodes.get(body, ()):
                raise ValueError(f'there is no node "{node}" of a body "{body}"')
        for body, state in self.data["modal_states"].items():
            m = self.modal[body]["modes"] if body in self.modal else None
            if len(state["coordinates"]) != m or len(state["rates"]) not in (0, m):
                raise ValueError(f'modal_states: body "{body}" has not so many modes')

    def _ordered(self, joints):
        """Joints, parents before children."""
        known, waiting, ordered = {"ground"}, list(joints), []
        while waiting:
            ready = [joint for joint in waiting if joint["parent"] in known]
            if not ready:
                raise ValueError(f'no way leads from the ground to joint "{waiting[0]["name"]}"')
            ordered += ready
            known |= {joint["child"] for joint in ready}
            waiting = [joint for joint in waiting if joint not in ready]
        return ordered

    def _number(self):
        """Places of coordinates in q and of speeds in u, and the state at the start."""
        q, u, self.slots, self.eta, self.efforts, self.prescribed = [], [], {}, {}, {}, {}
        for joint in self.joints:
            for n, freedom in enumerate(joint["freedoms"]):
                self.slots[joint["name"], n] = len(q), len(u)
                if freedom["motion"] == "ball":
                    q += freedom["quaternion"]
                    u += freedom["angular_velocity_rad_s"]
                elif freedom["motion"] == "free":
                    q += freedom["position_m"] + freedom["quaternion"]
                    u += freedom["angular_velocity_rad_s"] + freedom["velocity_m_s"]
                else:
                    self.efforts[len(u)] = function_of(freedom["effort"])
                    if freedom["prescribed"] is not None:
                        self.prescribed[len(u)] = function_of(freedom["prescribed"])
                    q.append(freedom["value"])
                    u.append(freedom["rate"])
            name = joint["child"]
            if name in self.modal:
                m = self.modal[name]["modes"]
                state = self.data["modal_states"].get(name, {})
                self.eta[name] = slice(len(q), len(q) + m), slice(len(u), len(u) + m)
                q += list(state.get("coordinates", [0.0] * m))
                u += list(state.get("rates") or [0.0] * m)
        self.nq, self.nu, self.start = len(q), len(u), np.array([*q, *u], float)

    def _scalars(self):
        for joint in self.joints:
            for n, freedom in enumerate(joint["freedoms"]):
                if freedom["motion"] not in ("ball", "free"):
                    yield freedom, *self.slots[joint["name"], n]

    def driven(self, t, y):
        """The state with prescribed coordinates put in, and their accelerations by place in u."""
        y, given = y.copy(), {}
        for _, i, j in self._scalars():
            if j in self.prescribed:
                y[i], y[self.nq + j], given[j] = self.prescribed[j](t)
        return y, given

    def node(self, frames, body, node, y):
        """The frame of a node of a body."""
        frame, u = frames[body], y[self.nq :]
        if body == "ground":
            return frame
        if body not in self.modal:
            rest = {"position_m": np.zeros(3), "rotation": np.eye(3)} if node == "origin" else None
            rest = rest or self.bodies[body]["nodes"][node]
            return frame.at(np.array(rest["position_m"]), np.array(rest["rotation"]))
        data, (qs, us) = self.modal[body]["nodes"][node], self.eta[body]
        point = {key: np.asarray(data[key])[None] for key in data}
        shift, Phi, bias, theta, Psi, turning = field(point, y[qs], u[us])
        R, jacobian, rate = turned_by(theta, Psi @ u[us])
        shift_map, turn_map = np.zeros((3, self.nu)), np.zeros((3, self.nu))
        shift_map[:, us], turn_map[:, us] = Phi[0], (jacobian @ Psi)[0]
        turn_bias = rate[0] @ (Psi[0] @ u[us]) + jacobian[0] @ turning[0]
        return frame.moved(shift[0], shift_map, bias[0], R[0] @ data["rotation"], turn_map, turn_bias, u)

    def frames(self, y):
        """The frame of every body, by name; where a node of a body is at its joint, the body's frame follows."""
        zero, none = np.zeros(3), np.zeros((3, self.nu))
        frames = {"ground": JacobianFrame(np.eye(3), zero, none, none, zero, zero, zero, zero)}
        for joint in self.joints:
            frame = self.node(frames, joint["parent"], joint["parent_node"], y)
            offset = joint["parent_offset"]
            frame = frame.at(np.array(offset["position_m"]), np.array(offset["rotation"]))
            for n, freedom in enumerate(joint["freedoms"]):
                frame = self._freed(frame, freedom, *self.slots[joint["name"], n], y)
            frames[joint["child"]] = self._body_frame(frame, joint, y)
        return frames

    def _freed(self, frame, freedom, i, j, y):
        """The frame beyond one freedom."""
        u, none, zero = y[self.nq :], np.zeros((3, self.nu)), np.zeros(3)
        if freedom["motion"] in ("ball", "free"):
            shift, shift_map, free = zero, none.copy(), freedom["motion"] == "free"
            R = matrix_of(y[i + 3 * free : i + 3 * free + 4])
            turn_map = none.copy()
            turn_map[:, j : j + 3] = R
            bias = zero
            if free:  # speeds in outboard axes, which turn: d/dt (R v) = w x R v
                shift = y[i : i + 3]
                shift_map[:, j + 3 : j + 6] = R
                bias = cross(R @ u[j : j + 3], R @ u[j + 3 : j + 6])
            return frame.moved(shift, shift_map, bias, R, turn_map, zero, u)
        axis = np.array(freedom["axis"])
        by_motion = {"turn": (1.0, 0.0), "slide": (0.0, 1.0), "screw": (1.0, freedom["pitch_m_rad"])}
        turns, shifts = by_motion[freedom["motion"]]
        shift_map, turn_map = none.copy(), none.copy()
        shift_map[:, j], turn_map[:, j] = shifts * axis, turns * axis
        return frame.moved(shifts * y[i] * axis, shift_map, zero, turn(axis, turns * y[i]), turn_map, zero, u)

    def _body_frame(self, outboard, joint, y):
        """The body's frame from that of its joint: the way back from a node, which may deform."""
        body, offset = joint["child"], joint["child_offset"]
        R, p = np.array(offset["rotation"]), np.array(offset["position_m"])
        node = outboard.at(-R.T @ p, R.T)
        zero, none = np.zeros(3), np.zeros((3, self.nu))
        alone = {body: JacobianFrame(np.eye(3), zero, none, none, zero, zero, zero, zero)}
        seen = self.node(alone, body, joint["child_node"], y)  # the node's motion seen from its body
        # R_body = R_node R_seen', and the same for all rates
        back = JacobianFrame(node.R @ seen.R.T, zero, none, none, zero, zero, zero, zero)
        B = back.R
        back.W, back.w = node.W - B @ seen.W, node.w - B @ seen.w
        back.alpha = node.alpha - B @ seen.alpha - cross(back.w, B @ seen.w)
        d = B @ seen.r
        back.r = node.r - d
        back.V, back.v = node.V - B @ seen.V + skew(d) @ back.W, node.v - B @ seen.v - cross(back.w, d)
        carried = cross(back.alpha, d) + cross(back.w, cross(back.w, d)) + 2.0 * cross(back.w, B @ seen.v)
        back.a = node.a - B @ seen.a - carried
        return back

    def points(self, frames, body, y):
        """Inertia points of a body: mass (n,), place of the mass centre (n,3), its V (n,3,N) and a (n,3), W (n,3,N), w
        (n,3), alpha (n,3), inertia (n,3,3)."""
        frame, u = frames[body], y[self.nq :]
        if body not in self.modal:
            data = self.bodies[body]
            at = frame.at(np.array(data["mass_centre_m"]), np.eye(3))
            inertia = frame.R @ np.array(data["inertia_kg_m2"]) @ frame.R.T
            one = (at.r, at.V, at.a, at.W, at.w, at.alpha, inertia)
            return np.array([data["mass_kg"]]), *(quantity[None] for quantity in one)
        p, (qs, us) = self.modal[body]["points"], self.eta[body]
        rate = u[us]
        rho, Phi, bias, theta, Psi, turning = field(p, y[qs], rate)
        if not self.modal[body]["turning"]:  # point masses: how they turn does not matter
            d = rho @ frame.R.T
            V = frame.V - skew(d) @ frame.W
            V[:, :, us] += frame.R @ Phi
            a = frame.a + cross(frame.alpha, d) + cross(frame.w, cross(frame.w, d)) + bias @ frame.R.T
            a = a + 2.0 * cross(frame.w, (Phi @ rate) @ frame.R.T)
            none = np.zeros((len(d), 3, 3))
            W = np.zeros_like(V)
            return p["mass_kg"], frame.r + d, V, a, W, none[:, 0], none[:, 0], none
        R, jacobian, jacobian_rate = turned_by(theta, Psi @ rate)
        spin = jacobian @ Psi  # angular velocity of the points in the body, by the modes
        spin_rate = (jacobian_rate @ (Psi @ rate)[..., None])[..., 0] + (jacobian @ turning[..., None])[..., 0]
        c = (R @ p["mass_centre_offset_m"][..., None])[..., 0]
        w_in = spin @ rate
        rho = rho + c
        Phi = Phi - skew(c) @ spin
        bias = bias + cross(spin_rate, c) + cross(w_in, cross(w_in, c))
        d = rho @ frame.R.T
        V = frame.V - skew(d) @ frame.W
        V[:, :, us] += frame.R @ Phi
        W = np.repeat(frame.W[None], len(d), axis=0)
        W[:, :, us] += frame.R @ spin
        w_rel, v_rel = w_in @ frame.R.T, (Phi @ rate) @ frame.R.T
        a = frame.a + cross(frame.alpha, d) + cross(frame.w, cross(frame.w, d)) + bias @ frame.R.T
        a = a + 2.0 * cross(frame.w, v_rel)
        alpha = frame.alpha + spin_rate @ frame.R.T + cross(frame.w, w_rel)
        axes = frame.R @ R
        inertia = axes @ p["inertia_kg_m2"] @ np.swapaxes(axes, 1, 2)
        return p["mass_kg"], frame.r + d, V, a, W, frame.w + w_rel, alpha, inertia

    def equations(self, t, y):
        """Mass matrix and right-hand side, for all speeds."""
        u, frames = y[self.nq :], self.frames(y)
        M, f = np.zeros((self.nu, self.nu)), np.zeros(self.nu)
        for body in self.bodies:
            if body in self.modal and self.modal[body]["summed"]:
                self._by_integrals(frames[body], body, y, M, f)
                continue
            m, _, V, a, W, w, alpha, inertia = self.points(frames, body, y)
            M += np.tensordot(m[:, None, None] * V, V, axes=((0, 1), (0, 1)))
            f += np.tensordot(m[:, None] * (self.gravity - a), V, axes=((0, 1), (0, 1)))
            if np.any(inertia):
                M += np.tensordot(inertia @ W, W, axes=((0, 1), (0, 1)))
                spun = (inertia @ w[..., None])[..., 0]
                torque = (inertia @ alpha[..., None])[..., 0] + cross(w, spun)
                f -= np.tensordot(torque, W, axes=((0, 1), (0, 1)))
        for body, (qs, us) in self.eta.items():
            f[us] -= self.modal[body]["stiffness"] @ y[qs] + self.modal[body]["damping"] @ u[us]
        for load, function in self.loads:
            at = self.node(frames, load["body"], load["node"], y)
            direction = np.array(load["direction"])
            vector = function(t)[0] * (direction if load["frame"] == "world" else at.R @ direction)
            f += (at.V if load["type"] == "force" else at.W).T @ vector
        for freedom, i, j in self._scalars():
            f[j] += self.efforts[j](t)[0] - freedom["stiffness"] * (y[i] - freedom["rest"]) - freedom["damping"] * u[j]
        for joint in self.joints:
            for n, freedom in enumerate(joint["freedoms"]):
                if freedom["motion"] == "ball":
                    i, j = self.slots[joint["name"], n]
                    pull = freedom["stiffness_Nm_rad"] * rotation_vector(y[i : i + 4])
                    f[j : j + 3] -= pull + freedom["damping_Nms_rad"] * u[j : j + 3]
        return M, f

    def _by_integrals(self, frame, body, y, M, f):
        """Add the inertia of a body of point masses to M and f, by the sums over its points; body axes."""
        c, (qs, us) = self.modal[body]["integrals"], self.eta[body]
        eta, rate, R = y[qs], y[self.nq :][us], frame.R
        w, alpha, a = frame.w @ R, frame.alpha @ R, (frame.a - self.gravity) @ R
        s = c["s0"] + c["s1"] @ eta
        J1 = c["J1"] + np.tensordot(eta, c["J2"], axes=(0, 1))  # sum m phi_n~' rho~
        J = c["J0"] + np.tensordot(eta, J1 + np.swapaxes(c["J1"], 1, 2), axes=(0, 0))
        C = c["C0"] + np.tensordot(eta, c["C1"], axes=(0, 0))
        block = np.block([
            [c["M_ff"], C.T, c["s1"].T], [C, J, skew(s)], [c["s1"], -skew(s), c["mass"] * np.eye(3)],
        ])  # fmt: skip
        one = np.zeros((len(eta), self.nu))
        one[:, us] = np.eye(len(eta))
        to_body = np.vstack([one, R.T @ frame.W, R.T @ frame.V])
        M += to_body.T @ block @ to_body
        swirl = 2.0 * np.tensordot(rate, np.swapaxes(J1, 1, 2), axes=(0, 0)) @ w
        modal = c["s1"].T @ a + C.T @ alpha - J1 @ w @ w + 2.0 * np.einsum("k,kan,a->n", rate, c["C1"], w)
        turning = cross(s, a) + J @ alpha + cross(w, J @ w) + swirl
        moving = c["mass"] * a + cross(alpha, s) + cross(w, cross(w, s)) + 2.0 * cross(w, c["s1"] @ rate)
        f -= to_body.T @ np.concatenate([modal, turning, moving])

    def accelerations(self, t, y):
        """udot (N,)."""
        return self.solved(t, y)[1]

    def solved(self, t, y):
        """The state with prescribed coordinates put in, udot (N,), and the load M udot - f (N,) that is left.

        The load is zero but for prescribed coordinates, where it is what drives them.
        """
        y, given = self.driven(t, y)
        M, f = self.equations(t, y)
        free = [j for j in range(self.nu) if j not in given]
        solution = np.zeros(self.nu)
        for j, value in given.items():
            solution[j] = value
        if free:
            known = f - M @ solution
            try:
                solution[free] = np.linalg.solve(M[np.ix_(free, free)], known[free])
            except np.linalg.LinAlgError:  # a trial step went far beyond what the modes mean: it will be a shorter one
                solution[:] = np.nan
        return y, solution, M @ solution - f

    def coordinate_rates(self, y):
        """dq/dt."""
        u, rate = y[self.nq :], np.zeros(self.nq)
        for joint in self.joints:
            for n, freedom in enumerate(joint["freedoms"]):
                i, j = self.slots[joint["name"], n]
                if freedom["motion"] == "ball":
                    rate[i : i + 4] = quaternion_rate(y[i : i + 4], u[j : j + 3])
                elif freedom["motion"] == "free":
                    rate[i : i + 3] = matrix_of(y[i + 3 : i + 7]) @ u[j + 3 : j + 6]
                    rate[i + 3 : i + 7] = quaternion_rate(y[i + 3 : i + 7], u[j : j + 3])
                else:
                    rate[i] = u[j]
        for qs, us in self.eta.values():
            rate[qs] = u[us]
        return rate

    def rates(self, t, y):
        """dy/dt."""
        y, udot, _ = self.solved(t, y)
        return np.concatenate([self.coordinate_rates(y), udot])

    def integrate(self, times, rtol=1e-13, method="DOP853"):
        """States (T, .) at the times, the first of which is 0."""
        y, _ = self.driven(0.0, self.start)
        inside = {t for t in breaks_of(self.data) if 0.0 < t < times[-1]}
        rows, ends = [y], sorted(inside | {float(times[-1])})
        begin = 0.0
        for end in ends:
            here = times[(times > begin) & (times <= end)]
            run = solve_ivp(self.rates, (begin, end), y, method, rtol=rtol, atol=1e-2 * rtol,
                            t_eval=np.unique(np.append(here, end)))  # fmt: skip
            if not run.success:
                raise ArithmeticError(run.message)
            rows += [run.y[:, k] for k, t in enumerate(run.t) if t in here]
            begin, y = end, run.y[:, -1]
        return np.array(rows)

    def channels(self, times, states):
        """The motion of markers, momentum and energies, by the names of the reference."""
        rows = {}
        for t, y in zip(times, states, strict=True):
            y, _ = self.driven(t, y)
            for name, value in self.observed(t, y).items():
                rows.setdefault(name, []).append(np.atleast_1d(value))
        return {name: np.array(values) for name, values in rows.items()}

    def observed(self, t, y):
        """Channels at one state."""
        u, frames, found = y[self.nq :], self.frames(y), {}
        for marker in self.data["markers"]:
            at = self.node(frames, marker["body"], marker["node"], y).at(np.array(marker["offset_m"]), np.eye(3))
            name = f"marker:{marker['name']}"
            found |= {f"{name}.position": at.r, f"{name}.orientation": quaternion_of(at.R)}
            found |= {f"{name}.velocity": at.v, f"{name}.angular_velocity": at.w}
        kinetic = gravity = strain = spring = 0.0
        linear, angular = np.zeros(3), np.zeros(3)
        for body in self.bodies:
            m, x, V, _, _, w, _, inertia = self.points(frames, body, y)
            v, spun = V @ u, (inertia @ w[..., None])[..., 0]
            kinetic += 0.5 * np.sum(m[:, None] * v * v) + 0.5 * np.sum(w * spun)
            gravity -= m @ x @ self.gravity
            linear += m @ v
            angular += np.sum(m[:, None] * cross(x, v) + spun, axis=0)
            if body in self.modal:
                eta = y[self.eta[body][0]]
                strain += 0.5 * eta @ self.modal[body]["stiffness"] @ eta
        for freedom, i, _ in self._scalars():
            spring += 0.5 * freedom["stiffness"] * (y[i] - freedom["rest"]) ** 2
        for joint in self.joints:
            for n, freedom in enumerate(joint["freedoms"]):
                if freedom["motion"] == "ball":
                    i = self.slots[joint["name"], n][0]
                    spring += 0.5 * freedom["stiffness_Nm_rad"] * np.sum(rotation_vector(y[i : i + 4]) ** 2)
        energies = {"kinetic": kinetic, "gravity": gravity, "strain": strain, "spring": spring}
        found |= {f"energy.{kind}": value for kind, value in energies.items()}
        found["energy.total"] = sum(energies.values())
        return found | {"momentum.linear": linear, "momentum.angular": angular}


def _flexible(body):
    """A flexible body with arrays, and how its inertia is summed."""
    points = {key: np.array(values) for key, values in body["points"].items()}
    integrals = {key: np.array(values) for key, values in body["integrals"].items()}
    turning = bool(np.any(points["inertia_kg_m2"]) or np.any(points["mass_centre_offset_m"]))
    return {
        "modes": len(body["stiffness"]), "points": points, "integrals": integrals, "turning": turning,
        "nodes": {name: {key: np.array(part) for key, part in node.items()} for name, node in body["nodes"].items()},
        "summed": bool(integrals) and "second_translation" not in points and not turning,
        "stiffness": np.array(body["stiffness"]), "damping": np.array(body["damping"]),
    }  # fmt: skip
