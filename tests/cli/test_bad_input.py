"""Bad input gives one plain line, exit code 2, and leaves no half-written file."""

from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with sound things, and with each kind of damage made from them."""
    world = tmp_path_factory.mktemp("world")
    small = {"rate_hz": 100.0, "scans_per_class": 3000}
    write_sessions(world / "honest", TengHandConfig(sessions=2, **small), lambda _: None)
    write_sessions(world / "paper", TengHandConfig(preset="paper", **small), lambda _: None)
    sound = (world / "honest" / "session-1.mcap").read_bytes()
    for name, data in {
        "short": sound[: len(sound) // 2],
        "flipped": flip(sound, len(sound) // 2),
        "text": b"no recording at all\n" * 50,
    }.items():
        (world / name).mkdir()
        (world / name / "one.mcap").write_bytes(data)
    (world / "empty").mkdir()
    (world / "notes").mkdir()
    (world / "notes" / "keep.txt").write_text("mine")
    main(["train", str(world / "honest"), "--output", str(world / "run"), "--epochs", "1",
          "--no-check", "--json"])  # fmt: skip
    main(["bundle", str(world / "run"), "--output", str(world / "good.taxel"), "--json"])
    good = (world / "good.taxel").read_bytes()
    (world / "bad.taxel").write_bytes(flip(good, len(good) // 3))
    (world / "glove.csv").write_text("t,a,b\n0,1,2\n10,3,oops\n20,5,6\n")
    (world / "nan.csv").write_text("t,a,b\n0,1,2\n10,nan,4\n20,5,6\n")
    for name, channels in {"text": "a[V] b[V]", "wrong": "a[V] zz[V]", "gap": "a[V] b[V]"}.items():
        file = "nan.csv" if name == "gap" else "glove.csv"
        (world / f"{name}.table.csv").write_text(
            f"file,label:sign,channels,time\n{file},x,{channels},t[ms]\n"
        )
    (world / "press.csv").write_text("t,a,b\n" + "".join(f"{10 * i},{i},2\n" for i in range(99)))
    (world / "press.table.csv").write_text(
        "file,label:sign,channels,time\npress.csv,x,a[N] b[N],t[ms]\n"
    )
    main(["import", str(world / "press.table.csv"), "--output", str(world / "newtons")])
    return world


def flip(data: bytes, place: int) -> bytes:
    damaged = bytearray(data)
    damaged[place] ^= 0x20
    return bytes(damaged)


CASES = {
    "unknown verb": "fly",
    "recording cut short": "train short --output out",
    "damaged recording": "train flipped --output out",
    "no recording": "train text --output out",
    "info of a damaged recording": "info flipped/one.mcap",
    "replay of a recording cut short": "live good.taxel replay://short/one.mcap?speed=max",
    "empty folder": "evaluate empty",
    "missing folder": "evaluate nowhere",
    "one class only": "evaluate paper/material-glass.mcap --target shape --split random",
    "a class with one session": "evaluate paper --target material --split group:session",
    "unknown target": "evaluate honest --target colour",
    "unknown group": "evaluate honest --split group:moon",
    "unknown split": "evaluate honest --split sometimes",
    "unknown model": "train honest --output out --model giant",
    "a baseline cannot be trained": "train honest --output out --model minirocket",
    "unknown recipe": "train honest --output out --recipe cake",
    "unknown channel": "train honest --output out --window channels=thumb",
    "no steps": "train honest --output out --window steps=0",
    "gate above everything": "train honest --output out --window gate=99",
    "volts for other units": "evaluate newtons --target sign",
    "gate from a recording that is not there": "train honest --output out --window gate=rest.mcap",
    "gate that is no number": "train honest --output out --window gate=high",
    "output that holds something else": "train honest --output notes",
    "bundle with a flipped byte": "live bad.taxel sim://teng",
    "no bundle": "live nothing.taxel sim://teng",
    "unknown scheme": "live good.taxel warp://teng",
    "unknown simulator": "live good.taxel sim://nose",
    "unknown option": "live good.taxel sim://teng?colour=red",
    "option of the wrong kind": "live good.taxel sim://teng?seed=x",
    "no time": "live good.taxel sim://teng --seconds 0",
    "bundle of no run": "bundle notes --output out.taxel",
    "simulate onto something": "simulate teng --output honest",
    "negative scans": "simulate teng --output out --scans-per-class -5",
    "force from high to low": "simulate teng --output out --force-n 5 1",
    "text in a number": "import text.table.csv --output out",
    "wrong columns": "import wrong.table.csv --output out",
    "NaN": "import gap.table.csv --output out",
    "recover nothing": "recover nowhere.mcap --output out.mcap",
    "preset unknown": "reproduce table-4-1 --preset fair",
    "no epochs": "train honest --output out --epochs 0",
    "no minutes": "train honest --output out --minutes 0",
    "one fold": "train honest --output out --fold-count 1",
    "no folds at random": "evaluate honest --split random --fold-count 0",
    "more folds than windows": "evaluate honest --split random --fold-count 100000",
    "overlap at random": "evaluate honest --split random --window stride=6",
    "more steps than rows": "train honest --output out --window steps=100000",
    "grid of 0 Hz": "train honest --output out --window grid=0",
    "grid that is not finite": "train honest --output out --window grid=nan",
    "gate that is not finite": "train honest --output out --window gate=inf",
    "levels that follow in layout A": "train honest --output out --window layout=A level=session:9",
    "levels beside references": "evaluate honest --recipe teng-referenced --window level=session:9",
    "levels of a group that is not there": "train honest --output out --window level=moon:9",
    "levels of no group": "train honest --output out --window level=9",
    "layout A without a gate": "train honest --output out --window layout=A gate=none",
    "negative seed": "train honest --output out --seed -1",
    "seed without end": "train honest --output out --seed 99999999999999999999",
    "data for output": "train honest --output honest",
    "bundle for data": "train good.taxel --output out",
    "page onto a folder": "evaluate honest --html notes",
    "page below a file": "evaluate honest --html good.taxel/page.html",
    "table without data": "reproduce table-4-1 --data nowhere --preset honest",
    "bundle onto a folder": "bundle run --output notes",
    "bundle without its data": "bundle run --output out.taxel --data nowhere",
    "bundle of a bundle": "bundle good.taxel --output out.taxel",
    "run in a bundle's place": "live run sim://teng",
    "recording in a bundle's place": "live honest/session-1.mcap sim://teng",
    "second bundle with a flipped byte": "live good.taxel sim://teng --also bad.taxel",
    "confidence above 1": "live good.taxel sim://teng --least-confidence 7",
    "confidence that is no number": "live good.taxel sim://teng --least-confidence nan",
    "time that is no number": "live good.taxel sim://teng --seconds nan",
    "no speed": "live good.taxel sim://teng?speed=0",
    "replay cut short": "live good.taxel replay://short/one.mcap?speed=max --json",
    "replay damaged": "live good.taxel replay://flipped/one.mcap?speed=max --json",
    "record onto a recording": "record sim://teng --output honest/session-1.mcap --seconds 1",
    "record nothing": "record sim://teng --output out.mcap --seconds 0",
    "label that is no pair": "record sim://teng --output out.mcap --seconds 1 --label sphere",
    "no sessions": "simulate teng --output out --sessions 0",
    "no force": "simulate teng --output out --force-n 0 1",
    "simulate below a file": "simulate teng --output notes/keep.txt/x --scans-per-class 99",
    "import onto something": "import press.table.csv --output honest",
}


@pytest.mark.parametrize("name", CASES)
def test_one_plain_line_exit_code_2_and_nothing_written(
    name: str, world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(world)
    before = sorted(str(path) for path in world.rglob("*"))

    with pytest.raises(SystemExit) as ended:
        main(CASES[name].split())

    lines = capsys.readouterr().err.strip().splitlines()
    assert ended.value.code == 2
    assert len(lines) == 1, lines
    assert lines[0].startswith("taxel: needed ")
    assert "; got " in lines[0]
    assert sorted(str(path) for path in world.rglob("*")) == before


def test_an_unknown_option_ends_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["models", "--no-such-option"])

    assert ended.value.code == 2
    assert capsys.readouterr().err
