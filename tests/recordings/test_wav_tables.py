"""Claims about importing WAV files: rate and channels of the file's head, one trial each."""

import wave

import numpy as np
import pytest
from scipy.io import wavfile

from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.reader import read_recording
from taxel.signals import Validity

RATE_HZ = 2000
VALUES = np.random.default_rng(0).integers(-(2**15), 2**15, (50, 2), np.int16)


@pytest.fixture
def folder(tmp_path):
    """Files of two classes."""
    for name in ("cup_1", "cup_2", "sponge_1", "sponge_2"):
        wavfile.write(tmp_path / f"{name}.WAV", RATE_HZ, VALUES)
    return tmp_path


def made(folder, table, **options):
    """Import a table; return the recordings."""
    (folder / "t.csv").write_text(table)
    return import_table(folder / "t.csv", folder / "out", options=ImportOptions(**options))


def refusal(folder, table) -> str:
    """Import a table that must be refused; return the one line."""
    with pytest.raises(BadTable) as caught:
        made(folder, table)
    assert "\n" not in str(caught.value)
    assert not (folder / "out").exists()
    return str(caught.value)


def test_a_folder_needs_one_line(folder):
    """Labels stand in the names; channels and time may be left out."""
    paths = made(folder, "file\n{label:object}_{group:take}.WAV\n")

    assert [path.name for path in paths] == [
        "cup_1.mcap", "cup_2.mcap", "sponge_1.mcap", "sponge_2.mcap"
    ]  # fmt: skip
    recording = read_recording(paths[2])
    sensor = recording.manifest.sensor
    assert (sensor.channels, sensor.units, sensor.rate_hz) == (("1", "2"), ("FS", "FS"), RATE_HZ)
    assert recording.manifest.labels == {"object": "sponge"}
    np.testing.assert_array_equal(recording.samples.values, (VALUES / 2**15).astype(np.float32))
    np.testing.assert_allclose(np.diff(recording.samples.fitted_s), 1 / RATE_HZ, rtol=1e-3)


def test_a_table_names_labels_and_channels(folder):
    """The channels that it names, in its order and unit; a rate that agrees with the head."""
    table = "file,label:object,channels,time\ncup_1.WAV,mug,2[Pa],rate:2000Hz\n"
    recording = read_recording(made(folder, table)[0])

    assert recording.manifest.labels == {"object": "mug"}
    assert recording.manifest.sensor.units == ("Pa",)
    np.testing.assert_array_equal(
        recording.samples.values, (VALUES[:, 1:] / 2**15).astype(np.float32)
    )


def test_intervals_mark_trials_of_a_long_file(folder):
    """As of any other file."""
    (folder / "iv.csv").write_text("file,start_s,end_s,label:x\ncup_1.WAV,0,0.01,a\n")
    (folder / "t.csv").write_text("file\ncup_1.WAV\n")
    (path,) = import_table(folder / "t.csv", folder / "out", intervals=folder / "iv.csv")

    assert [mark.labels for mark in read_recording(path).marks] == [{"x": "a"}]


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("cup_1.WAV,3[V],,", r"channels by their numbers, 1 to 2: .*'3'"),
        ("cup_1.WAV,left[V],,", r"channels by their numbers, 1 to 2: .*'left'"),
        ("cup_1.WAV,,t[s],", "an empty column 'time' for a WAV file"),
        ("cup_1.WAV,,rate:44100Hz,", "the rate of the file's head, 2000 Hz; got 44100 Hz"),
        ("cup_1.WAV,,,channels rows", "for a file of one trial"),
        ("short.wav,,,", "as many bytes of values as its head says; got 6 .* in .*short.wav"),
        ("none.wav,,,", "which is not there"),
        ("nan.wav,,,", r"a finite .*got nan in .*nan\.wav, value 2 of channel 1; .*--missing keep"),
        ("empty.wav,,,", "rows of numbers; got none"),
    ],
)
def test_what_a_wav_file_cannot_be_is_refused(folder, row, words):
    """In one line that names the file."""
    whole = (folder / "cup_1.WAV").read_bytes()
    (folder / "short.wav").write_bytes(whole[:50])
    wavfile.write(folder / "nan.wav", RATE_HZ, np.array([0.5, np.nan], np.float32))
    (folder / "empty.wav").write_bytes(whole[:40] + bytes(4))

    import re

    assert re.search(words, refusal(folder, f"file,channels,time,axes\n{row}\n"))


def test_values_that_are_no_numbers_are_kept_on_request(folder):
    """Flagged, as those of other files."""
    wavfile.write(folder / "nan.wav", RATE_HZ, np.array([0.5, np.nan], np.float32))
    recording = read_recording(made(folder, "file\nnan.wav\n", missing="keep")[0])

    assert recording.samples.validity.ravel().tolist()[0] == 0
    assert recording.samples.validity.ravel().tolist()[1] != 0


def write_integers(path, bits, numbers):
    """Write integers of one channel, those of 8 bits as they stand without a sign."""
    with wave.open(str(path), "wb") as file:
        file.setparams((1, bits // 8, RATE_HZ, len(numbers), "NONE", ""))
        file.writeframes(b"".join(number.to_bytes(bits // 8, "little", signed=bits > 8)
                                  for number in numbers))  # fmt: skip


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_integers_at_either_end_are_saturated_where_a_full_scale_is_stated(folder, bits):
    """The highest of them is less than 1, and the lowest is far below; their neighbours are not."""
    half = 2 ** (bits - 1)
    near = half - 1 - 2 ** max(0, bits - 24)  # another number in 32 bits, too
    ends = np.array([half - 1, near, 0, -near, -half])
    write_integers(folder / "a.wav", bits, (ends + (half if bits == 8 else 0)).tolist())

    (path,) = made(folder, "file,full_scale\na.wav,1\n")
    flags = read_recording(path).samples.validity.ravel().tolist()
    assert [bool(flag & Validity.SATURATED) for flag in flags] == [True, False, False, False, True]

    (plain,) = made(folder, "file\na.wav\n", overwrite=True)
    assert not read_recording(plain).samples.validity.any()


def test_floats_are_saturated_from_the_stated_value_on_only(folder):
    """They have no ends."""
    wavfile.write(folder / "a.wav", RATE_HZ, np.array([1.0, 0.99999994, -1.0, -9.0], np.float32))
    (path,) = made(folder, "file,full_scale\na.wav,1\n")
    flags = read_recording(path).samples.validity.ravel()
    assert flags.tolist() == [Validity.SATURATED, 0, 0, 0]


def test_marks_of_missing_values_are_shares_of_full_scale(folder):
    """As the values are."""
    write_integers(folder / "a.wav", 16, [-32768, 16384, 5])
    (path,) = made(folder, "file,missing\na.wav,-32768 -1 0.5\n")
    assert np.isnan(read_recording(path).samples.values.ravel()).tolist() == [True, True, False]


def test_unreadable_files_are_left_out_on_request(folder):
    """As others are."""
    (folder / "broken_1.WAV").write_bytes(b"RIFF")
    paths = made(folder, "file\n{label:object}_{group:take}.WAV\n", skip_unreadable=True)

    assert len(paths) == 4


def test_a_wav_file_in_the_tables_place_is_described(folder):
    """With what it holds."""
    with pytest.raises(BadTable, match="a WAV file: 2 channels of 50 values, 16-bit integers"):
        import_table(folder / "cup_1.WAV", folder / "out")
    (folder / "cut.wav").write_bytes(b"RIFF")
    with pytest.raises(BadTable, match=r"cannot be read either: needed a WAV file \(RIFF\)"):
        import_table(folder / "cut.wav", folder / "out")
