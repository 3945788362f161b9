"""A run: from a scene to a run folder, with records, pictures, a cache and checkpoints written on the way."""

import json
import logging
import math
import platform
import shutil
import time
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import warp as wp

import warpsph
from warpsph.measure.energy import drift_and_converted
from warpsph.measure.leaks import behind_walls
from warpsph.measure.waves import celerity, find_impact, find_wave
from warpsph.output.checkpoint import read_checkpoint, write_checkpoint
from warpsph.output.progress import Progress
from warpsph.output.records import Record, find_crest, read_record
from warpsph.output.writers import Outputs
from warpsph.scene.scene import Scene
from warpsph.simulation import BlowUpError, Simulation
from warpsph.step.bodies import columns as body_columns

log = logging.getLogger("warpsph")

DONE, STOPPED, BLEW_UP = "done", "stopped", "blew up"


class FolderError(Exception):
    """The run folder cannot be used; the text is one line for the user."""


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
    ) -> None:
        """Set the scene up and open its folder. `began` is when the program started (time.perf_counter) [s].

        Raises:
            SceneError: the scene cannot be set up; nothing has been written.
            FolderError: the folder holds another run.
            CheckpointError: there is nothing to resume.
            DeviceError: there is no such device.
        """
        self._began = time.perf_counter() if began is None else began
        folder = Path(folder)
        self.scene, self.folder = scene, folder
        if not resume:
            refuse_used_folder(folder, overwrite)
        self.simulation = Simulation(scene, device, threads)
        if resume:
            read_checkpoint(folder / "checkpoints", self.simulation)
            self.simulation.enter_phase()
            self.simulation.step.resume()
        elif folder.exists():
            shutil.rmtree(folder)
        for name in ("gauges", "fluids", "checkpoints", *(["bodies"] if scene.bodies else [])):
            (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / "STOP").unlink(missing_ok=True)
        # A run that goes on must not choose anew: other neighbours, other bits.
        resolved = scene.model_copy(update={"neighbours": self.simulation.scene.neighbours})
        (folder / "scene.yaml").write_text(resolved.resolved_yaml(), encoding="utf-8")
        self._log_file = logging.FileHandler(folder / "log.txt", mode="a" if resume else "w", encoding="utf-8")
        self._log_file.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
        log.addHandler(self._log_file)
        log.setLevel(logging.INFO)  # in a notebook too, where nobody has set it

        now = self.simulation.time
        self._samples = Ticks(scene.output.samples_per_second, now, is_done=resume)
        self._frames = Ticks(scene.output.frames_per_second, max(now, 0.0), is_done=resume and now >= 0.0)
        self._checkpoints = Ticks(1.0 / scene.output.checkpoint_every, now, is_done=True)
        self._records = self._open_records(now if resume else None)
        self._outputs = Outputs(self.simulation.scene, self.simulation, folder, self._frames.index if resume else None)

    def _open_records(self, resume_at: float | None) -> dict[str, Record]:
        unit = "[J/m]" if self.scene.dimensions == 2 else "[J]"
        of_bodies = ("bodies kinetic", "bodies potential") if self.scene.bodies else ()
        energies = ("kinetic", "potential", "internal", "dissipated", "wall work", "damped", *of_bodies, "total")
        motion = ("x [m]", "z [m]", "u [m/s]", "w [m/s]", "front [m]", "top speed [m/s]")
        columns = {
            "energy": [f"{name} {unit}" for name in energies],
            **{f"gauges/{name}": ["level [m]"] for name in self.simulation.gauges.names},
            **{f"fluids/{name}": motion for name in self.simulation.model.fluid_names},
            **{f"bodies/{body.name}": body_columns(self.scene.dimensions) for body in self.scene.bodies},
        }
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
        simulation, end = self.simulation, self.scene.run.end_time
        first_step, outcome, why = simulation.step_count, DONE, ""
        progress = Progress(simulation.time, end, simulation.model.particle_count, first_step)
        count, now = simulation.model.particle_count, simulation.time
        log.info("%s: %d particles, from t = %g s to %g s", self.scene.title, count, now, end)
        for warning in simulation.start.warnings:
            log.warning("%s", warning)
        started = first_steps = time.perf_counter()
        try:
            self._emit()
            while simulation.time < end:
                simulation.advance(self._next_event())
                if first_steps == started:
                    first_steps = time.perf_counter()
                if simulation.time in simulation.phase_changes():
                    simulation.enter_phase()
                self._emit()
                progress.update(simulation.time, simulation.step_count)
                if self._is_told_to_stop():
                    outcome, why = STOPPED, f"at t = {simulation.time:g} s, by a STOP file or max_steps"
                    break
        except BlowUpError as error:
            outcome, why = BLEW_UP, str(error)
        except KeyboardInterrupt:
            outcome, why = STOPPED, f"at t = {simulation.time:g} s, from the keyboard"
        finally:
            progress.close()
            for record in self._records.values():
                record.close()
        seconds = max(time.perf_counter() - started, 1e-9)
        if outcome == STOPPED and simulation.state.clock()["dt"] == 0.0:
            self._outputs.wait()
            write_checkpoint(self.folder / "checkpoints", simulation)
        log.info("%s %s", outcome, why)
        log.removeHandler(self._log_file)
        self._log_file.close()
        facts = self._facts(outcome, why)
        facts["speed"] = {
            "steps": simulation.step_count - first_step,
            "seconds": round(seconds, 3),
            "particle updates per second": round(
                (simulation.step_count - first_step) * simulation.model.particle_count / seconds
            ),
            "list rebuilds": simulation.step.neighbours.rebuilds,
            "seconds to the first steps": round(first_steps - self._began, 3),
        }
        self._write_facts(facts)  # before the rest, which may fail for want of disk
        self._outputs.finish()
        self._write_facts(facts)
        self._outputs.report()
        self._write_facts(facts)
        return facts

    def _write_facts(self, facts: dict[str, Any]) -> None:
        facts["speed"]["seconds, all output included"] = round(time.perf_counter() - self._began, 3)
        (self.folder / "run.json").write_text(json.dumps(facts, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")

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
            for name, motion in zip(simulation.model.fluid_names, motions, strict=True):
                (x, _, z), (u, _, w) = motion.center, motion.velocity
                self._records[f"fluids/{name}"].write(now, [x, z, u, w, motion.front, motion.top_speed])
        if self._frames.take(now):
            self._outputs.write_frame()
        if self._checkpoints.take(now):
            self._outputs.wait()
            write_checkpoint(self.folder / "checkpoints", simulation)

    def _is_told_to_stop(self) -> bool:
        most = self.scene.run.max_steps
        return (self.folder / "STOP").exists() or (most is not None and self.simulation.step_count >= most)

    def _facts(self, outcome: str, why: str) -> dict[str, Any]:
        """Provenance, counts, conservation and crests, as run.json holds them."""
        simulation, scene = self.simulation, self.scene
        model = simulation.model
        device = simulation.launcher.device
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
            "particles behind walls": int(behind_walls(model, simulation.state.position).sum()),
            **({"origin [m]": list(simulation.scene.origin)} if any(simulation.scene.origin) else {}),
            "conservation": self._conservation(),
            "gauges": self._crests(),
            **self._impacts(),
            "warnings": list(simulation.start.warnings),
        }

    def _conservation(self) -> dict[str, float]:
        """Mass now over mass at the start, and how far the energy sum strayed, over the energy converted."""
        _, motions = self.simulation.energy.measure()
        model = self.simulation.model
        placed = float(model.parameters.mass.numpy().astype(float) @ self.simulation.start.counts)
        drift, converted = drift_and_converted(read_record(self.folder / "energy.csv"))
        facts = {"mass / mass placed": sum(motion.mass for motion in motions) / placed}
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

    def _crests(self) -> dict[str, dict[str, float]]:
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
                }
        return found


def refuse_used_folder(folder: Path, overwrite: bool) -> None:
    """Raise FolderError if `folder` holds a run that may not be overwritten, or anything that is no run."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not (folder / "scene.yaml").exists():
        raise FolderError(f"{folder}: is there already and holds no run; choose another --out")
    if not overwrite:
        raise FolderError(f"{folder}: holds another run; give --overwrite to replace it, or another --out")
