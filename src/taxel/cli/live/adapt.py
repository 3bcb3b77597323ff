"""`taxel adapt`: a trained run or bundle learns on, and keeps what it was before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from taxel.bundles.contract import Contract
    from taxel.bundles.levels import TouchLevel
    from taxel.bundles.versions import Change
    from taxel.training.run import Run
    from taxel.windows.windower import Windows


@dataclass(frozen=True, slots=True)
class Stored:
    """The number of an adapted version, and whether it is new."""

    version: int
    """Its number."""
    changed: bool
    """False where it equals, byte for byte, the one in use before."""


@dataclass(frozen=True, kw_only=True)
class Adapt:
    """Adapt a bundle or run to a changed pad, teach a run a new class, or correct it.

    Without --output the previous version is kept beside the new one, as NAME.v1, NAME.v2 …;
    list versions with --history, and return to one with --rollback.
    """

    trained: tyro.conf.Positional[Path]
    """A bundle of an array, NAME.taxel, or a run's folder."""
    touches: Path | None = None
    """A recording of a few touches of the known object that the training's reference names, on the
    pad, gel or session as it is now. Alone, they rescale each channel. With --new or --correct,
    they scale those recordings. They also scale --test, except sessions that hold such touches of
    their own."""
    new: tuple[Path, ...] = ()
    """Runs: recordings of grasps of a class that it does not know yet, labelled."""
    grasps: int = 5
    """--new: number of grasps of each class to learn from; the first ones are taken."""
    correct: Path | None = None
    """Runs: a recording with correct labels; its grasps are predicted and then learned in
    their order. Detects drift (needs taxel[adapt])."""
    test: Path | None = None
    """Labelled recordings to measure accuracy on before and after, by class: with --touches alone,
    of that session; with --new or --correct, without the grasps to learn, and best with all
    classes. Unless given, the grasps that the run rehearses, on which accuracy is too high."""
    output: Path | None = None
    """Write the adapted version here, and leave the existing one as it is."""
    history: bool = False
    """Show all versions."""
    rollback: Annotated[tuple[int, ...] | None, tyro.conf.arg(metavar="[INT]")] = None
    """Return to a version by its number; to the previous one unless a number is given."""
    json: bool = False
    """Print JSON; accuracies are shares of windows, prequential and unlearned of grasps that gave
    a window, 0 to 1; levels in the channels' units."""

    RULES: ClassVar = (Only(("grasps",), "--new", lambda o: o.new),)

    def run(self) -> None:
        """Adapt, or show or bring back versions."""
        from taxel.bundles.shipped import find_bundle
        from taxel.bundles.versions import named_path, settle

        trained = find_bundle(named_path(self.trained))
        if trained != self.trained:
            replace(self, trained=trained).run()  # "." has no name that others could stand beside
            return
        self._check_asked()
        settle(trained)  # puts a folder back that a kill caught between two names
        self._check_found()
        if self.history:
            self._show_history()
        elif self.rollback is not None:
            self._roll_back()
        elif self.new:
            self._learn_class()
        elif self.correct is not None:
            self._learn_corrections()
        else:
            self._bring_to_level()

    def _check_asked(self) -> None:
        """Refuse, before anything is read or written, what cannot be meant."""
        asked = {"--new": bool(self.new), "--correct": self.correct is not None,
                 "--history": self.history, "--rollback": self.rollback is not None}  # fmt: skip
        ways = [name for name, given in asked.items() if given]
        if len(ways) > 1 or not (ways or self.touches):
            raise BadInput(
                "one of --touches, --new, --correct, --history and --rollback",
                " and ".join(ways) or "none", "choose one",
            )  # fmt: skip
        beside = "--touches" if self.touches is not None else "--test"
        if (self.touches or self.test) and (self.history or self.rollback is not None):
            raise BadInput(f"{ways[0]} alone", f"{ways[0]} and {beside}", "do one after the other")
        if self.grasps < 1:
            raise BadInput("--grasps of at least 1", str(self.grasps), "give a larger number")
        if self.rollback is not None and len(self.rollback) > 1:
            raise BadInput("one version for --rollback", str(len(self.rollback)), "name one")

    def _check_found(self) -> None:
        """Refuse what does not fit what is there, before anything is written."""
        from taxel.bundles.envelope import is_grasp_bundle, need_bundle

        if is_grasp_bundle(self.trained):
            raise BadInput(
                "a bundle of an array, or a run's folder",
                f"{self.trained.name}, of tactile cameras",
                "leave it as it is: it sees each grasp relative to that grasp's own settled start",
            )  # fmt: skip
        is_run = (self.trained / "run.json").exists()
        if (self.new or self.correct) and not is_run:
            raise BadInput(
                f"a run's folder for {'--new' if self.new else '--correct'}", f"{self.trained}",
                "name a folder that taxel train wrote, and bundle it again afterwards",
            )  # fmt: skip
        if not is_run and not self.history and self.rollback is None:
            need_bundle(self.trained)
        if self.output is not None and (
            self.output.exists() or self.history or self.rollback is not None
        ):
            raise BadInput(
                "a name that is free for --output, where something is adapted",
                f"{self.output}", "choose another, or leave it out to keep versions",
            )  # fmt: skip

    def _bring_to_level(self) -> None:
        from taxel.bundles.envelope import is_signed
        from taxel.bundles.files import bundle_at_level
        from taxel.bundles.levels import measure_level
        from taxel.bundles.reader import read_contract
        from taxel.bundles.versions import Change
        from taxel.recordings.whole import write_whole
        from taxel.training.adapt.new_data import measured_at
        from taxel.training.run import save_at_level

        assert self.touches is not None
        is_run = (self.trained / "run.json").exists()
        run = _load(self.trained) if is_run else None
        contract = run.contract if run is not None else read_contract(self.trained)
        signed = False
        level = measure_level(self.touches, contract)
        before, after = (
            measured_at(self._predictor(run), contract, self.test, level) if self.test else ({}, {})
        )
        change = Change(
            what=f"brought to the level of {number_of(level.touches, 'touch')}",
            data=(str(self.touches),), data_digest=level.digest, before=before, after=after,
        )  # fmt: skip
        place = self._place()
        if run is not None:
            save_at_level(place, run, level.level)
        else:
            signed = is_signed(self.trained)
            write_whole(place, bundle_at_level(self.trained, level.level)[1])
        stored = self._store(place, change)
        if self.json:
            print_json({
                "output": str(self.output or self.trained),
                "version": stored.version, "changed": stored.changed,
                "touches": level.touches, "windows": level.windows,
                "channels": contract.channels, "level": level.level.tolist(),
                "change": level.change.tolist(), "silent": level.silent.tolist(),
                "warnings": level.warnings,
                "measured_on": self.test and str(self.test), "before": before, "after": after,
            })  # fmt: skip
            return
        from taxel.views.tables.adapt import before_after_table, level_table

        console.print(level_table(contract, level))
        if after:
            console.print(before_after_table(change, f"{self.test}, as measured"))
        self._say_stored(stored)
        if signed:
            again = self.output or self.trained
            sign = command("taxel", "bundle", again, "--sign", "KEY", "--output", again)
            say(f"it was signed and, being another bundle now, is not any more: {sign}")

    def _learn_class(self) -> None:
        from taxel.bundles.versions import Change
        from taxel.training.adapt.correcting import measured
        from taxel.training.adapt.last_layer import adapt_last_layer
        from taxel.training.adapt.new_data import read_grasps
        from taxel.training.run import save_run

        run = _load(self.trained)
        with progress() as bar:
            task = bar.add_task("reading", total=None)
            self._check_test(self.new)
            level = self._level(run.contract)
            grasps = read_grasps(self.new, run.contract, level).first(self.grasps)
            names = sorted(set(grasps.label) - set(run.contract.classes))
            if not names:
                raise BadInput(
                    f"grasps of a class beside {', '.join(run.contract.classes)}",
                    f"only {', '.join(sorted(set(grasps.label)))}",
                    "learn more of known classes with --correct",
                )
            bar.update(task, description="learning")
            adapted = adapt_last_layer(
                run, grasps.windows, grasps.label, grasps.grasp, grasps.session,
                recordings=set(grasps.recording),
            )  # fmt: skip
            bar.update(task, description="measuring")
            before, after = measured(run, adapted.run, self.test, level)
        each = (f"{name!r} from {number_of(grasps.count(name), 'grasp')}" for name in names)
        change = Change(
            what=f"new class {', '.join(each)}", data=tuple(map(str, self.new)),
            data_digest=grasps.digest, before=before, after=after,
        )  # fmt: skip
        place = self._place()
        save_run(place, _made(adapted.run))
        stored = self._store(place, change)
        detail: dict[str, Any] = {
            "new": {name: grasps.count(name) for name in names},
            "statistics": adapted.statistics,
            "stands_out": adapted.stands_out,
            "seconds": adapted.seconds,
        }
        features = (
            "each channel's statistics stand beside the network's features now"
            if adapted.statistics
            else "the network's own features are enough"
        )
        lines = [f"{change.what}: {adapted.seconds:.2f} s; {features}"]
        if run.contract.unknown is not None:
            lines += ["the test for unknown touch is left out: it was learned without this class"]
        self._say(adapted.run.contract, change, stored, detail, lines)

    def _learn_corrections(self) -> None:
        from taxel.bundles.versions import Change
        from taxel.training.adapt.correcting import learn_corrections, measured
        from taxel.training.adapt.new_data import clock_time, read_grasps
        from taxel.training.run import save_run

        assert self.correct is not None
        run = _load(self.trained)
        with progress() as bar:
            task = bar.add_task("reading", total=None)
            self._check_test([self.correct])
            level = self._level(run.contract)
            grasps = read_grasps([self.correct], run.contract, level)
            bar.update(task, description="learning", total=len(set(grasps.grasp)))
            learned = learn_corrections(run, grasps, on_grasp=lambda _: bar.update(task, advance=1))
            before, after = measured(run, learned.run, self.test, level)
        change = Change(
            what=number_of(learned.grasps, "corrected grasp"), data=(str(self.correct),),
            data_digest=grasps.digest, before=before, after=after,
        )  # fmt: skip
        place = self._place()
        save_run(place, _made(learned.run))
        stored = self._store(place, change)
        times = [
            clock_time(self.correct, learned.order[drift.grasp], learned.starts[drift.grasp])
            for drift in learned.drifts
        ]
        detail = {
            "grasps": learned.grasps,
            "prequential": learned.prequential,
            "unlearned": learned.unlearned,
            "drifts": [asdict(drift) | {"since": time}
                       for drift, time in zip(learned.drifts, times, strict=True)],
        }  # fmt: skip
        lines = [
            f"{number_of(learned.grasps, 'grasp')} that gave a window: "
            f"{learned.prequential:.1%} correct while "
            f"learning, {learned.unlearned:.1%} by the run as it was"
        ] + [
            f"drift since {time} (doubt {drift.before:.2f} → {drift.after:.2f}): touch the "
            "reference object, and give that recording to --touches"
            for drift, time in zip(learned.drifts, times, strict=True)
        ]
        self._say(learned.run.contract, change, stored, detail, lines)

    def _check_test(self, learned: Sequence[Path]) -> None:
        from taxel.training.adapt.new_data import check_apart

        if self.test is not None:
            check_apart(learned, self.test)

    def _level(self, contract: Contract) -> TouchLevel | None:
        from taxel.bundles.levels import measure_level

        return measure_level(self.touches, contract) if self.touches is not None else None

    def _predictor(self, run: Run | None) -> Callable[[Windows], NDArray[np.floating]]:
        """Return what gives the probabilities of windows; a bundle needs no training framework."""
        if run is not None:
            from taxel.training.adapt.correcting import run_probabilities

            return partial(run_probabilities, run)
        from taxel.bundles.reader import read_bundle

        bundle = read_bundle(self.trained)
        return lambda windows: bundle.probabilities(windows.values, windows.mask)

    def _place(self) -> Path:
        """Return where to write what is adapted."""
        from taxel.bundles.versions import new_path

        return self.output or new_path(self.trained)

    def _store(self, place: Path, change: Change) -> Stored:
        """Store a finished version beside the others, or at --output; return its number."""
        from taxel.bundles.versions import begin_history, digest_of, replace_with

        if self.output is not None:
            return Stored(begin_history(place, self.trained, change).number, True)
        before = digest_of(self.trained)
        version = replace_with(self.trained, place, change)
        return Stored(version.number, version.digest != before)

    def _say(
        self, contract: Contract, change: Change, stored: Stored, detail: dict[str, Any],
        lines: Sequence[str],
    ) -> None:  # fmt: skip
        """Print what was done, by JSON or in lines that each stand alone."""
        from taxel.bundles.versions import class_key

        measured_on = str(self.test) if self.test else "the run's rehearsed grasps"
        untested = [name for name in contract.classes if class_key(name) not in change.before]
        if self.json:
            print_json(
                {"output": str(self.output or self.trained),
                 "version": stored.version, "changed": stored.changed, **detail,
                 "measured_on": measured_on, "not_tested": untested,
                 "before": change.before, "after": change.after}
            )  # fmt: skip
            return
        from taxel.views.tables.adapt import before_after_table

        for line in lines:
            say(line)
        console.print(before_after_table(change, measured_on))
        if untested:
            lost = "what was lost or won of these is not known"
            say(f"--test holds no {', '.join(untested)}: {lost}", style="yellow")
        self._say_stored(stored)

    def _say_stored(self, stored: Stored) -> None:
        name, version = self.output or self.trained, stored.version
        if not stored.changed:
            say(f"{name}: nothing changed, it is version {version} already; no version is added")
            return
        back = (
            "" if self.output else f"; back with: {command('taxel', 'adapt', name, '--rollback')}"
        )
        say(f"{name}: version {version}{back}")

    def _show_history(self) -> None:
        from taxel.bundles.versions import read_history

        found = read_history(self.trained)
        if self.json:
            print_json(asdict(found))
            return
        from taxel.views.tables.adapt import history_table

        console.print(history_table(self.trained, found))

    def _roll_back(self) -> None:
        from taxel.bundles.versions import roll_back

        number = self.rollback[0] if self.rollback else None
        found = roll_back(self.trained, number)
        if self.json:
            print_json(asdict(found))
            return
        say(f"{self.trained}: version {found.number} again ({found.change.what})")  # fmt: skip


def _load(path: Path) -> Run:
    from taxel.bundles.versions import read_history
    from taxel.training.run import load_run

    read_history(path)  # a damaged one is refused before the work, not after it
    return load_run(path)


def _made(run: Run) -> Run:
    from taxel.training.environment import Provenance

    return replace(run, made=Provenance.now())
