"""A run: from a scene to a run folder, with records, pictures, a cache and checkpoints written on the way."""

import json
import logging
import math
import platform
import signal
import sys
import threading
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
import yaml

import warpsph
from warpsph.measure.energy import drift_and_converted
from warpsph.measure.instruments import columns as instrument_columns
from warpsph.measure.leaks import behind_walls
from warpsph.measure.waves import celerity, find_impact, find_wave
from warpsph.output.analysis import analysis
from warpsph.output.checkpoint import CheckpointError, differences, find_checkpoint, read_checkpoint, write_checkpoint
from warpsph.output.claim import FolderError, Lock, Mark, clear, digest, read_json, refuse_foreign, write_whole
from warpsph.output.gauge_waves import read_observed
from warpsph.output.progress import Progress, tell
from warpsph.output.records import TIME_ROUNDING, Record, find_crest, is_rising, last_time, read_record
from warpsph.output.writers import FILES, Outputs
from warpsph.placement.sound import with_sound
from warpsph.scene.scene import Scene
from warpsph.simulation import BlowUpError, Simulation
from warpsph.step.bodies import columns as body_columns

log = logging.getLogger("warpsph")

# How long the thread that draws may keep the interpreter from the one that steps, which wants it after each launch [s].
# Python's own 5 ms are as long as some thirty steps of a small scene on a GPU.
TURN = 2e-4

DONE, STOPPED, BLEW_UP = "done", "stopped", "blew up"


# What may differ when a run goes on: nothing of it moves a particle.
SOUND = ("title", "source", "allow", "run.end_time", "run.max_steps", "output")
MOST_NAMED = 12  # A line of more fields that differ is not read to its end.
# What adds up over the sessions of a run.
SUMS = ("steps", "seconds", "list rebuilds", "seconds, all output included")


class Ticks:
    """Times k / rate, k whole, from `start` on, or after it if what is due at `start` has been done."""

    def __init__(self, rate: float, start: float, is_done: bool) -> None:
        self._rate = rate
        self.index = math.ceil(start * rate + (1e-6 if is_done else -1e-6))

    @property
    def next(self) -> float:
        """The next time [s]."""
        return self.index / self._rate

    def take(self, time: float) -> bool:
        """Whether a tick is due at `time` [s]; if so, go on to the next."""
        is_due = time > self.next - 1e-9
        self.index += is_due
        return is_due


class Run:
    """One scene, one folder, one simulation; scenes/README.md describes the folder."""

    def __init__(
        self,
        scene: Scene,
        folder: Path | str,
        *,
        device: str = "cpu",
        threads: int | None = None,
        overwrite: bool = False,
        resume: bool = False,
        began: float | None = None,
        scene_file: Path | None = None,
    ) -> None:
        """Set the scene up and open its folder. `began` is when the program started (time.perf_counter) [s].

        `scene_file` is where the scene was read: a new run never writes to a folder that holds it.

        Raises:
            SceneError: the scene cannot be set up; nothing has been written.
            FolderError: the folder holds another run, or something else, or runs now; or what it holds cannot go on
                like this. Nothing has been touched.
            CheckpointError: there is nothing to resume.
            DeviceError: there is no such device.
        """
        self._began = time.perf_counter() if began is None else began
        folder = Path(folder)
        self.scene = scene = with_sound(scene)
        self.folder = folder
        columns = _columns(scene)
        paths = [f"{name}.csv" for name in columns]
        read_observed(scene)  # a report at the end would be too late to miss it
        if resume and not folder.is_dir():
            raise CheckpointError(f"{folder}: no such folder")
        if not resume:
            refuse_foreign(folder, overwrite, scene_file, paths, FILES)
        lock = Lock(folder) if folder.is_dir() else None  # while a scene is set up, too, which may take minutes
        try:
            if resume:
                self.scene = scene = _refuse_unsound(scene, folder)
            self.simulation = Simulation(scene, device, threads)
            if lock is None:
                folder.mkdir(parents=True, exist_ok=True)
                lock = Lock(folder)
            self._lock = lock
            if resume:
                read_checkpoint(folder / "checkpoints", self.simulation)
                self.simulation.enter_phase()
                self.simulation.step.resume()
            else:
                refuse_foreign(folder, overwrite, scene_file, paths, FILES)  # another run may have come and gone since
                clear(folder, FILES)
            self._open(columns, resume)
        except BaseException:
            if lock is not None:
                lock.release()
            raise

    def _open(self, columns: dict[str, Sequence[str]], resume: bool) -> None:
        """Make all that is written to in the run folder, which is ours."""
        scene, folder = self.scene, self.folder
        # A run that goes on must not choose anew: other neighbours, other bits.
        self._yaml = scene.model_copy(update={"neighbours": self.simulation.scene.neighbours}).resolved_yaml()
        Mark.of(self._yaml, (f"{name}.csv" for name in columns)).write(folder)
        self._sessions = read_json(folder / "run.json").get("sessions", []) if resume else []
        self._checkpoint_step, self._is_written = -1, True
        for name in {"gauges", "fluids", "checkpoints", *(Path(path).parent for path in columns)}:
            (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / "STOP").unlink(missing_ok=True)
        write_whole(folder / "scene.yaml", self._yaml)
        self._log_file = logging.FileHandler(folder / "log.txt", mode="a" if resume else "w", encoding="utf-8")
        self._log_file.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
        log.addHandler(self._log_file)
        log.setLevel(logging.INFO)  # in a notebook too, where nobody has set it
        if self._lock.left_by:
            log.warning("%s: %s ended without a word; its lock is taken over", folder, self._lock.left_by)

        now = self.simulation.time
        self._samples = Ticks(scene.output.samples_per_second, now, is_done=resume)
        self._frames = Ticks(scene.output.frames_per_second, max(now, 0.0), is_done=resume and now >= 0.0)
        self._checkpoints = Ticks(1.0 / scene.output.checkpoint_every, now, is_done=True)
        self._records = self._open_records(columns, now if resume else None)
        self._outputs = Outputs(self.simulation.scene, self.simulation, folder, self._frames.index if resume else None)

    def _open_records(self, columns: dict[str, Sequence[str]], resume_at: float | None) -> dict[str, Record]:
        origins = dict(zip(("x [m]", "y [m]", "z [m]"), self.simulation.scene.origin, strict=True))
        origins |= {"front [m]": origins["x [m]"], "level [m]": origins["z [m]"]}
        return {
            name: Record(
                self.folder / f"{name}.csv", heading, resume_at, [origins.get(column, 0.0) for column in heading]
            )
            for name, heading in columns.items()
        }

    def execute(self) -> dict[str, Any]:
        """Run to the end, to a STOP file or to a blow-up. Returns what run.json holds."""
        usual = sys.getswitchinterval()
        sys.setswitchinterval(TURN)
        try:
            return self._execute()
        finally:
            sys.setswitchinterval(usual)
            self._lock.release()

    def _execute(self) -> dict[str, Any]:
        simulation, end = self.simulation, self.scene.run.end_time
        first_step, outcome, why, began_at = simulation.step_count, DONE, "", simulation.time
        progress = Progress(simulation.time, end, simulation.model.particle_count, first_step)
        count, now = simulation.model.particle_count, simulation.time
        log.info("%s: %d particles, from t = %g s to %g s", self.scene.title, count, now, end)
        for warning in simulation.start.warnings:
            log.warning("%s", warning)
        started = first_steps = time.perf_counter()
        signals = _Signals()
        try:
            self._emit()
            while simulation.time < end:
                self._is_written = False
                simulation.advance(self._next_event())
                if first_steps == started:
                    first_steps = time.perf_counter()
                if simulation.time in simulation.phase_changes():
                    simulation.enter_phase()
                self._emit()
                progress.update(simulation.time, simulation.step_count)
                by = self._is_told_to_stop(signals)
                if by and simulation.time < end:
                    outcome, why = STOPPED, f"at t = {simulation.time:g} s, by {by}"
                    break
        except BlowUpError as error:
            outcome, why = BLEW_UP, str(error)
        except KeyboardInterrupt:
            outcome, why = STOPPED, f"at t = {simulation.time:g} s, in the middle of a step"
        finally:
            signals.let_go()
            progress.close()
            for record in self._records.values():
                record.close()
        seconds = max(time.perf_counter() - started, 1e-9)
        # So that a later --until goes on from here; not from where a step was cut short, or its outputs were.
        if outcome != BLEW_UP and simulation.state.clock()["dt"] == 0.0 and self._is_written:
            self._write_checkpoint()
        log.info("%s %s", outcome, why)
        log.removeHandler(self._log_file)
        self._log_file.close()
        facts = self._facts(outcome, why)
        session = {
            "from [s]": began_at,
            "to [s]": simulation.time,
            "outcome": outcome,
            "steps": simulation.step_count - first_step,
            "seconds": round(seconds, 3),
            "list rebuilds": simulation.step.neighbours.rebuilds,
            "seconds to the first steps": round(first_steps - self._began, 3),
            **{name: facts["provenance"][name] for name in ("device", "threads", "finished")},
        }
        facts["sessions"] = [*self._sessions, session]
        self._write_facts(facts)  # before the rest, which may fail for want of disk
        self._outputs.finish()
        self._write_facts(facts)
        self._outputs.report()
        self._write_facts(facts)
        return facts

    def _write_facts(self, facts: dict[str, Any]) -> None:
        sessions = facts["sessions"]
        sessions[-1]["seconds, all output included"] = round(time.perf_counter() - self._began, 3)
        sums = {name: sum(session[name] for session in sessions) for name in SUMS}
        updates = sums["steps"] * self.simulation.model.particle_count
        facts["speed"] = {
            **{name: round(value, 3) for name, value in sums.items()},
            "particle updates per second": round(updates / max(sums["seconds"], 1e-9)),
            "seconds to the first steps": sessions[-1]["seconds to the first steps"],
        }
        write_whole(self.folder / "run.json", json.dumps(facts, indent=2, ensure_ascii=False) + "\n")

    def _write_checkpoint(self) -> None:
        """Write a checkpoint of now, unless there is one, after all that it stands for."""
        for record in self._records.values():
            record.confirm()
        if self._checkpoint_step == self.simulation.step_count:
            return
        self._outputs.wait()
        write_checkpoint(self.folder / "checkpoints", self.simulation, self._yaml + _files_of(self.scene))
        self._checkpoint_step = self.simulation.step_count

    def _next_event(self) -> float:
        now = self.simulation.time
        ticks = (self._samples.next, self._frames.next, self._checkpoints.next)
        changes = [change for change in self.simulation.phase_changes() if change > now]
        return min(*ticks, *changes, self.scene.run.end_time)

    def _emit(self) -> None:
        """Write whatever is due now; the checkpoint last, so that what it stands for has been written."""
        simulation, now = self.simulation, self.simulation.time
        # The warm-up is stepped from sample to sample too, for the sake of its progress, but nothing of it is recorded.
        if self._samples.take(now) and now >= 0.0:
            budget, motions = simulation.energy.measure()
            of_bodies = simulation.bodies.energies() if simulation.bodies else ()
            self._records["energy"].write(now, [*budget.parts(), *of_bodies, budget.total])
            if simulation.bodies:
                for name, row in zip(simulation.bodies.names, simulation.bodies.rows(), strict=True):
                    self._records[f"bodies/{name}"].write(now, row)
            for name, level in zip(simulation.gauges.names, simulation.gauges.levels(), strict=True):
                self._records[f"gauges/{name}"].write(now, [level])
            for name, row in simulation.instruments.rows(now):
                self._records[name].write(now, row)
            for name, motion in zip(simulation.model.fluid_names, motions, strict=True):
                (x, _, z), (u, _, w) = motion.center, motion.velocity
                self._records[f"fluids/{name}"].write(now, [x, z, u, w, motion.front, motion.top_speed])
        gone = simulation.leaving.gone
        for one in gone:
            row = [one.id, one.fluid, *one.position, *one.velocity, one.is_absurd]
            self._records["left"].write(one.time, [float(value) for value in row])
        gone.clear()
        if self._frames.take(now):
            self._outputs.write_frame()
        self._is_written = True
        if self._checkpoints.take(now):
            self._write_checkpoint()

    def _is_told_to_stop(self, signals: "_Signals") -> str:
        """By what the run is told to stop; empty if by nothing."""
        most = self.scene.run.max_steps
        if signals.received:
            return signals.received
        if (self.folder / "STOP").exists():
            return "a STOP file"
        return "run.max_steps" if most is not None and self.simulation.step_count >= most else ""

    def _facts(self, outcome: str, why: str) -> dict[str, Any]:
        """Provenance, counts, conservation and crests, as run.json holds them."""
        simulation, scene = self.simulation, self.scene
        model = simulation.model
        device = simulation.launcher.device
        behind, fluid = behind_walls(model, simulation.state.position), simulation.state.fluid.numpy()
        return {
            "title": scene.title,
            "source": scene.source,
            "outcome": outcome,
            "why": why,
            "time [s]": simulation.time,
            "provenance": {
                "warpsph": warpsph.__version__,
                "warp": wp.config.version,
                "python": platform.python_version(),
                "machine": platform.platform(),
                "device": device.name,
                "threads": simulation.launcher.threads,
                "finished": datetime.now(UTC).isoformat(timespec="seconds"),
            },
            "counts": {
                "particles": model.particle_count,
                "wall points": simulation.start.wall_count,
                **({"body points": simulation.bodies.set.point_count} if simulation.bodies else {}),
                **dict(zip(model.fluid_names, simulation.start.counts, strict=True)),
            },
            "particles behind walls": int(np.count_nonzero(behind & (fluid < len(model.fluid_names)))),
            **self._left(),
            **({"origin [m]": list(simulation.scene.origin)} if any(simulation.scene.origin) else {}),
            "conservation": self._conservation(),
            "gauges": self._crests(),
            **self._impacts(),
            **analysis(scene, self.folder),
            "warnings": list(simulation.start.warnings),
        }

    def _left(self) -> dict[str, Any]:
        """What has left, of a run in which something has."""
        record = read_record(self.folder / "left.csv")
        if not len(record["time [s]"]):
            return {}
        model, fluid = self.simulation.model, record["fluid"].astype(int)
        volume = self.simulation.model.parameters.mass.numpy() / model.parameters.rest_density.numpy()
        unit = "m2" if self.scene.dimensions == 2 else "m3"
        facts = {
            "particles": len(fluid),
            "dropped as absurd": int(record["dropped"].sum()),
            f"volume [{unit}]": float(volume[fluid].sum()),
            "share of all particles": len(fluid) / model.particle_count,
            "first [s]": float(record["time [s]"][0]),
            "last [s]": float(record["time [s]"][-1]),
            "from [m]": [float(record[f"{axis} [m]"].min()) for axis in "xyz"],
            "to [m]": [float(record[f"{axis} [m]"].max()) for axis in "xyz"],
        }
        return {"left": facts}

    def _conservation(self) -> dict[str, float]:
        """Mass now and mass that has left over mass at the start, and how far the energy sum strayed, over the energy
        converted."""
        _, motions = self.simulation.energy.measure()
        model = self.simulation.model
        mass = model.parameters.mass.numpy()[: len(model.fluid_names)].astype(float)
        placed = float(mass @ self.simulation.start.counts)
        gone = read_record(self.folder / "left.csv")["fluid"].astype(int)
        # What water of this weight has to lose on its way to the ground, on the average.
        start = self.simulation.start
        height = float(start.fluid_box[1][2]) - start.ground
        at_stake = 0.5 * placed * self.scene.gravity * height
        drift, converted = drift_and_converted(read_record(self.folder / "energy.csv"), at_stake)
        here = sum(motion.mass for motion in motions)
        facts = {"mass / mass placed": (here + float(mass[gone].sum())) / placed}
        if converted:
            facts["energy converted"] = converted
            facts["energy drift / converted"] = drift / converted
        return facts

    def _impacts(self) -> dict[str, Any]:
        """How bodies of a 2-D scene came into its water, and the waves that passed its gauges."""
        scene, bodies = self.scene, self.simulation.bodies
        fill = next((fluid for fluid in scene.fluids if fluid.fill), None)
        if bodies is None or fill is None or scene.dimensions == 3:
            return {}
        level = fill.fill.level
        ground = self.simulation.model.ground + self.simulation.scene.origin[2]
        about = {"depth": level - ground, "gravity": scene.gravity}
        impacts, waves = {}, {}
        for body in bodies.set.bodies:
            record = read_record(self.folder / "bodies" / f"{body.name}.csv")
            mass = {"mass": body.mass.mass, "inertia": float(body.mass.inertia[1, 1])}
            corners = body.outline.polygon() - body.mass.centre[[0, 2]]
            found = find_impact(record, corners, level=level, **about, **mass)
            if found:
                impacts[body.name] = {
                    "time [s]": found.time,
                    "speed [m/s]": found.speed,
                    "Froude number": found.froude,
                    "kinetic energy [J/m]": found.energy,
                    "kinetic energy at the first contact [J/m]": found.arrival,
                }
        total = sum(impact["kinetic energy [J/m]"] for impact in impacts.values())
        density = scene.materials[fill.material].density
        passed = []
        for gauge in scene.gauges if impacts else ():
            time, height = read_record(self.folder / "gauges" / f"{gauge.name}.csv").values()
            wave = find_wave(time, height - height[0], **about, density=density) if len(time) else None
            if wave is None:
                continue
            passed.append((gauge.name, gauge.x, wave))
            waves[gauge.name] = {
                "crest amplitude [m]": find_crest(time, height)[0],
                "solitary amplitude [m]": wave.fit.amplitude,
                "likeness to a solitary wave, R2": wave.fit.r2,
                "period [s]": wave.period,
                "kinetic energy [J/m]": wave.kinetic,
                "potential energy [J/m]": wave.potential,
                "energy / kinetic energy of the impact": (wave.kinetic + wave.potential) / total,
            }
        # Of the crest from the gauge before; at the first, which has none before it, on to the next.
        for (name, x, near), (next_name, next_x, far) in pairwise(passed):
            if far.fit.crest > near.fit.crest:
                waves[next_name]["celerity [m/s]"] = celerity(near, far, next_x - x)
                waves[name].setdefault("celerity [m/s]", waves[next_name]["celerity [m/s]"])
        return {"impacts": impacts, "waves": waves} if impacts else {}

    def _crests(self) -> dict[str, dict[str, Any]]:
        found = {}
        for gauge in self.scene.gauges:
            time, level = read_record(self.folder / "gauges" / f"{gauge.name}.csv").values()
            if len(time):
                amplitude, at = find_crest(time, level)
                found[gauge.name] = {
                    "x [m]": gauge.x,
                    "still level [m]": float(level[0]),
                    "crest amplitude [m]": amplitude,
                    "crest time [s]": at,
                    **({"still rising": True} if is_rising(time, level) else {}),
                }
        return found


class _Signals:
    """Holds Ctrl-C and the signals that end a program, so that a run stops at its next record, with a checkpoint.

    A second one stops it at once.

    Attributes:
        received: The name of the one that has come.
    """

    NAMES = ("SIGINT", "SIGTERM", "SIGHUP")

    def __init__(self) -> None:
        self.received = ""
        self._before: dict[int, Any] = {}
        if threading.current_thread() is not threading.main_thread():
            return  # Python hands them to no other
        for name in self.NAMES:
            number = getattr(signal, name, None)  # not every system has them all
            if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):  # as nohup has it
                self._before[number] = signal.signal(number, self._take)

    def _take(self, number: int, _: object) -> None:
        if self.received:
            raise KeyboardInterrupt
        self.received = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        tell("stopping at the next record; once more, and it stops at once\n", sys.stderr)

    def let_go(self) -> None:
        """Give them back to whoever had them."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()


def _columns(scene: Scene) -> dict[str, Sequence[str]]:
    """The columns of each record of a run after its time, by the path of its file without .csv."""
    unit = "[J/m]" if scene.dimensions == 2 else "[J]"
    of_bodies = ("bodies kinetic", "bodies potential") if scene.bodies else ()
    energies = ("kinetic", "potential", "internal", "dissipated", "wall work", "damped", "gone", *of_bodies, "total")
    motion = ("x [m]", "z [m]", "u [m/s]", "w [m/s]", "front [m]", "top speed [m/s]")
    return {
        "energy": [f"{name} {unit}" for name in energies],
        "left": ["id", "fluid", "x [m]", "y [m]", "z [m]", "u [m/s]", "v [m/s]", "w [m/s]", "dropped"],
        **{f"gauges/{gauge.name}": ["level [m]"] for gauge in scene.gauges},
        **instrument_columns(scene),
        **{f"fluids/{fluid.name}": motion for fluid in scene.fluids},
        **{f"bodies/{body.name}": body_columns(scene.dimensions) for body in scene.bodies},
    }


def _refuse_unsound(scene: Scene, folder: Path) -> Scene:
    """Raise unless the run in `folder` can go on as `scene`, of which nothing was changed but outputs and the end.

    Nothing is touched. Returns the scene with the neighbours that the run has chosen.

    Raises:
        CheckpointError: there is none to go on from.
        FolderError: the run has come farther than that, or to its end, or the scene is another one.
        FileNotFoundError: a frame of the cache is missing.
    """
    reached = find_checkpoint(folder / "checkpoints")
    if reached.scene:
        if scene.neighbours == "auto":
            scene = scene.model_copy(update={"neighbours": yaml.safe_load(reached.scene)["neighbours"]})
        changed = differences(reached.scene, scene.resolved_yaml() + _files_of(scene))
        unsound = [path for path in changed if not _is_sound(path, scene)]
        if unsound:
            named = "; ".join(f"{path} was {changed[path]}" for path in unsound[:MOST_NAMED])
            more = f"; and {len(unsound) - MOST_NAMED} more" if len(unsound) > MOST_NAMED else ""
            raise FolderError(f"{folder}: a run goes on as it began, but {named}{more}; set back, or run anew")
        for path in changed:
            log.log(
                logging.INFO if path == "run.end_time" else logging.WARNING,
                *("%s: goes on with %s, which was %s", folder, path, changed[path]),
            )
    else:
        log.warning("%s: does not tell its scene; whether that was changed since cannot be told", reached.path)
    end, facts = scene.run.end_time, read_json(folder / "run.json")
    now = max(reached.time, last_time(folder / "energy.csv"))
    if end < now - TIME_ROUNDING:
        raise FolderError(f"{folder}: has reached t = {now:g} s, which is beyond {end:g} s; give a later --until")
    if reached.time >= end and facts.get("outcome") == DONE:
        raise FolderError(f"{folder}: is done, at t = {now:g} s; a later --until goes on from there")
    if scene.run.max_steps is not None and reached.step >= scene.run.max_steps:
        raise FolderError(f"{folder}: has done {reached.step} steps, all that run.max_steps allows; give more")
    if scene.output.usd:
        from warpsph.output.usd import require_frames  # USD takes a while to load

        frames = Ticks(scene.output.frames_per_second, max(reached.time, 0.0), is_done=reached.time >= 0.0)
        require_frames(folder / "usd", frames.index)
    return scene


def _files_of(scene: Scene) -> str:
    """What the files hold that a scene names, as one more field of its YAML: their digests by their paths."""
    parts = [part for body in scene.bodies for part in (body.shape.mesh, body.motion) if part is not None]
    parts += [scene.wave_maker] if scene.wave_maker else []
    paths = [Path(part.file) for part in parts if getattr(part, "file", None)]
    known = {str(path): digest(path.read_bytes())[:12] if path.is_file() else "absent" for path in paths}
    return yaml.safe_dump({"files": known}) if known else ""


def _is_sound(path: str, scene: Scene) -> bool:
    """Whether a run can go on though the field at `path` differs: if it moves no particle, and breaks no sequence."""
    if path == "output.frames_per_second":
        return not (scene.output.pictures or scene.output.usd)  # the frames so far would be at other times
    if path == "output.usd":
        return not scene.output.usd  # the frames so far would be missing
    return any(path == sound or path.startswith((f"{sound}.", f"{sound}[")) for sound in SOUND)
