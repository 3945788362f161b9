"""A run: from a scene to a run folder, with records, pictures, a cache and checkpoints written on the way."""

import json
import logging
import signal
import sys
import threading
import time
from collections.abc import Sequence
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import Any

from warpsph.findings import findings
from warpsph.measure.instruments import columns as instrument_columns
from warpsph.output.checkpoint import CheckpointError, read_checkpoint, write_checkpoint
from warpsph.output.claim import Lock, Mark, clear, read_json, refuse_foreign, write_whole
from warpsph.output.gauge_waves import read_observed
from warpsph.output.progress import Progress, tell
from warpsph.output.records import Record
from warpsph.output.resuming import files_of, refuse_unsound
from warpsph.output.run_folder import BLEW_UP, DONE, STOPPED
from warpsph.output.ticks import Ticks
from warpsph.output.writers import FILES, Outputs
from warpsph.placement.sound import with_sound
from warpsph.scene.scene import Scene
from warpsph.simulation import BlowUpError, Simulation
from warpsph.step.bodies import columns as body_columns

log = logging.getLogger("warpsph")

# How long the thread that draws may keep the interpreter from the one that steps, which wants it after each launch [s].
# Python's own 5 ms are as long as some thirty steps of a small scene on a GPU.
TURN = 2e-4
# What adds up over the sessions of a run.
SUMS = ("steps", "seconds", "list rebuilds", "seconds, all output included")


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
        self.folder = folder
        columns = _columns(scene)
        paths = [f"{name}.csv" for name in columns]
        read_observed(scene)  # a report at the end would be too late to miss it
        if resume and not folder.is_dir():
            raise CheckpointError(f"{folder}: no such folder")
        if not resume:
            refuse_foreign(folder, overwrite, scene_file, paths, FILES)
        lock = Lock(folder) if folder.is_dir() else None  # while a scene is set up, too, which may take minutes
        self._early = MemoryHandler(1000, logging.CRITICAL + 1)  # what is told before there is a log.txt
        log.addHandler(self._early)
        try:
            scene = with_sound(scene)
            self.scene = scene = refuse_unsound(scene, folder) if resume else scene
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
        finally:
            log.removeHandler(self._early)

    def _open(self, columns: dict[str, Sequence[str]], resume: bool) -> None:
        """Make all that is written to in the run folder, which is ours."""
        scene, folder = self.scene, self.folder
        # A run that goes on must not choose anew: other neighbours, other bits.
        self._yaml = scene.model_copy(update={"neighbours": self.simulation.scene.neighbours}).resolved_yaml()
        Mark.of(self._yaml, (f"{name}.csv" for name in columns)).write(folder)
        self._sessions = read_json(folder / "run.json").get("sessions", []) if resume else []
        self._checkpoint_step, self._is_written = -1, True
        for name in {"gauges", "fluids", "checkpoints", *(str(Path(path).parent) for path in columns)}:
            (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / "STOP").unlink(missing_ok=True)
        write_whole(folder / "scene.yaml", self._yaml)
        self._log_file = logging.FileHandler(folder / "log.txt", mode="a" if resume else "w", encoding="utf-8")
        self._log_file.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
        log.removeHandler(self._early)
        self._early.setTarget(self._log_file)
        self._early.close()
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
        facts = findings(simulation, self.scene, self.folder, outcome, why)
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
        write_checkpoint(self.folder / "checkpoints", self.simulation, self._yaml + files_of(self.scene))
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
        """Put the handlers of before in their places."""
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
