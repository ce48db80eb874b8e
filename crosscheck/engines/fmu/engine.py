"""The engine "fmu:FILE": the file is an FMU, or a mapping of one."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import assert_never

from crosscheck.engines.contract import USUAL_S, Effort, Model, Support
from crosscheck.engines.fmu.archive import FmuArchive, read_archive
from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.fmu.layout import MappedColumns, of_mapping, of_own
from crosscheck.engines.fmu.mapping import MappingFile, read_mapping
from crosscheck.engines.fmu.model import FmuInterface, FmuModel
from crosscheck.engines.fmu.scenes import foreign_obstacle, is_own_scene, own_obstacle
from crosscheck.engines.pace import pace
from crosscheck.engines.peer import needed
from crosscheck.engines.steps import ladder
from flexmb.kept import kept
from flexmb.scene.files import load_scene
from flexmb.scene.problems import SceneError
from flexmb.scene.schema import Scene, SidBody
from flexmb.scene.user_code import user_code_is_forbidden

PREFIX = "fmu:"
TOLERANCES = 1e-7, 1e-9, 1e-11, 1e-13
RUNGS = 4
EXCHANGE, SIMULATION = "CVode", "doStep"
"""Methods of efforts: FMPy's CVode, and the integrator in the FMU."""
OWN_STEP = "step"
"""The parameter with the largest step of Co-Simulation of an FMU that flexmb has exported."""


class FmuEngine:
    """An FMU of FMI 2 or 3. Nothing of its code is loaded before a scene is compiled; all that can be wrong with the
    file and the mapping is said by `version`, which every session asks first."""

    takes = ("connectors", "couplings", "total_loads", "t_start")
    summary = "a model of one scene, made by any tool"
    algorithm = "that of the tool that made it"
    settings = (
        "Model Exchange in FMPy's CVode, backward differences of variable order, called from Python; or Co-Simulation "
        "by the FMU's own integrator, in equal communication steps. The timed solve contains the reading of samples."
    )

    def __init__(self, name: str) -> None:
        self.name = name
        self._given = Path(name.removeprefix(PREFIX))

    def version(self) -> str:
        """The model, its version of FMI and the digests of the FMU and its mapping, and FMPy's version.

        EngineMissing without FMPy; BadFmu for a file that is no FMU or cannot run here, a foreign one without a
        mapping, a mapping that does not fit, and where code of users is forbidden.
        """
        if user_code_is_forbidden():
            raise BadFmu(f"{self._given}: an FMU is native code of its author, which --no-user-code forbids")
        with needed("FMPy", "flexmb[fmu]"):
            from fmpy import __version__ as fmpy_version
        self._check()
        archive, mapped = self._archive, self._mapping_digest
        return f"{archive.name}, FMI {archive.version}, {archive.digest}{mapped}, FMPy {fmpy_version}"

    def supports(self, scene: Scene) -> Support:
        """ "exact" for a scene that the FMU models, else "no"."""
        reason = self._obstacle(scene)
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """Those of a run of usual duration."""
        return self.efforts_for(scene, USUAL_S)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Tolerances of CVode; of Co-Simulation communication steps by halves, or tolerances if the mapping says so.

        The coarsest step is the start value of the FMU's own step, if it is set too, else one that fits the scene.
        """
        interface = self._way.interface
        match interface:
            case "model exchange":
                return tuple(Effort("tolerance", value, EXCHANGE) for value in TOLERANCES)
            case "co-simulation":
                if self._mapping.efforts == "tolerances":
                    return tuple(Effort("tolerance", value, SIMULATION) for value in TOLERANCES)
                step = self._way.step
                if step is not None and step.start:  # what its author thought fit, explicit methods may need
                    return tuple(Effort("step", step.start / 2**rung, SIMULATION) for rung in range(RUNGS))
                return ladder(SIMULATION, pace(scene, duration_s), duration_s, RUNGS)
            case _:
                assert_never(interface)

    def compile(self, scene: Scene) -> Model:
        """EngineMissing without FMPy; BadFmu for what is wrong with the FMU, and ValueError for another scene."""
        self.version()
        if reason := self._obstacle(scene):
            raise ValueError(f'scene "{scene.name}": {reason}')
        return FmuModel(self._archive, self._layout(scene), self._way, scene)

    @kept
    def _files(self) -> tuple[Path, Path | None]:
        """The FMU, and its mapping, if there is one."""
        if self._given.suffix.lower() == ".toml":
            if not self._given.is_file():
                raise BadFmu(f"{self._given}: there is no such file")
            named = read_mapping(self._given).fmu
            return self._given.parent / named if named else self._given.with_suffix(".fmu"), self._given
        beside = self._given.with_suffix(".toml")
        return self._given, beside if beside.is_file() else None

    @kept
    def _archive(self) -> FmuArchive:
        return read_archive(self._files[0])

    @kept
    def _mapping_file(self) -> Path | None:
        """The file that counts: beside an FMU that flexmb has exported its scene may have the name of a mapping."""
        is_named = self._files[1] == self._given
        return None if self._archive.own is not None and not is_named else self._files[1]

    @kept
    def _mapping(self) -> MappingFile:
        file = self._mapping_file
        return MappingFile() if file is None else read_mapping(file)

    @property
    def _mapping_digest(self) -> str:
        file = self._mapping_file
        return "" if file is None else f" by {hashlib.sha256(file.read_bytes()).hexdigest()[:16]}"

    @kept
    def _is_own(self) -> bool:
        """Whether names and units follow from the FMU: flexmb has exported it, and the mapping has no channels."""
        return self._archive.own is not None and not self._mapping.channels

    @kept
    def _modelled(self) -> Scene:
        """The scene that a foreign FMU models."""
        file, named = self._mapping_file, self._mapping.scene
        assert file is not None
        if named is None:
            raise BadFmu(f'{file} does not say which scene the FMU models: add scene = "FILE.toml"')
        try:
            return load_scene(file.parent / named)
        except (SceneError, OSError) as error:
            raise BadFmu(f"{file}: its scene cannot be read: {error}") from None

    @kept
    def _way(self) -> FmuInterface:
        archive, mapping = self._archive, self._mapping
        offered = tuple(archive.interfaces)
        interface = offered[0] if mapping.interface is None else mapping.interface
        where = self._mapping_file or archive.path
        if interface not in offered:
            raise BadFmu(f"{where} asks for {interface}, and {archive.path} offers {' and '.join(offered)} alone")
        if interface == "model exchange":
            for key, unused in (("efforts", mapping.efforts != "steps"), ("step", mapping.step is not None)):
                if unused:
                    raise BadFmu(f'{where}: "{key}" is of co-simulation, and this is model exchange: leave it out')
            return FmuInterface(interface)
        name = mapping.step or (OWN_STEP if archive.own is not None else None)
        if name is None:
            return FmuInterface(interface)
        variable = archive.variable(name)
        if variable.fixed:
            raise BadFmu(f'{where}: the step "{name}" cannot be set: {variable.fixed}')
        if variable.unit is not None and (variable.unit.factor, variable.unit.exponents) != (1.0, (0, 0, 1)):
            raise BadFmu(f'{where}: the step "{name}" is in {variable.unit.name}, and s is wanted')
        return FmuInterface(interface, variable)

    def _check(self) -> None:
        """BadFmu for all that can be wrong before a scene is known."""
        archive = self._archive
        if archive.own is None and self._mapping_file is None:
            raise BadFmu(
                f"{archive.path} is none of flexmb's own exports, so a mapping must say what its variables are: write "
                f"{archive.path.with_suffix('.toml').name} beside it (docs/fmu-engine.md)"
            )
        self._way  # noqa: B018  (it raises)
        if not self._is_own:
            assert self._mapping_file is not None
            of_mapping(archive, self._mapping, self._modelled, str(self._mapping_file))

    def _obstacle(self, scene: Scene) -> str:
        """Why the FMU is no model of the scene, "" if it is one."""
        if scene.controllers or scene.events:
            return (
                "an FMU is one model, whose controllers and events crosscheck does not see: compare the scene without"
            )
        by_pace = self._way.interface == "co-simulation" and self._way.step is None
        if by_pace and any(isinstance(body, SidBody) for body in scene.bodies):
            return "communication steps follow from the pace of a scene, and that of a SID body is in its file"
        if self._is_own:
            return own_obstacle(self._archive, scene)
        if reason := foreign_obstacle(self._modelled, scene, self._layout(self._modelled).paths):
            return reason
        try:
            self._layout(scene)
        except BadFmu as error:
            return str(error)
        return ""

    def _layout(self, scene: Scene) -> MappedColumns:
        if self._is_own:
            layout = of_own(self._archive, scene)
            return layout._replace(settings=()) if is_own_scene(self._archive, scene) else layout
        return of_mapping(self._archive, self._mapping, scene, str(self._mapping_file))
